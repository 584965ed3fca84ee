"""The light of a spike-continuous panel, pixel by pixel over time, in compiled code.

It has the same drives and the same emitter as `GoldenRenderer`, with which a test compares it, but
another order: all planes of a few pixels, then the next pixels. Long waveforms of few pixels and
sums over a patch are then fast.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Viform
from cosim.compute.cores import cores
from cosim.compute.stopping import threads
from display.drives import DRIVES
from display.drives.compiled import compiled, level, remember
from display.panels.emitter import Emitter, gone_in, relax
from display.panels.panel import SpikePanel

_LANES: Final = 64
"""Number of pixels that are stepped together; their state fits into the first-level cache. The
offsets of an array of this constant length let the compiler vectorise the step."""
_PLANES: Final = 8
"""Number of planes in a step, for which the state is loaded once."""
_TAU, _AGE, _LIT, _MEMORY, _EMITTED, _GLOW, _LIGHT = (n * _LANES for n in range(7))
"""Offsets of the state of the pixels, and of the light of the planes of a step."""
_LONG: Final = 10**8
"""Number of pixel-planes from which on two threads share the pixels."""
Values = npt.NDArray[np.float64]


@njit(cache=True, nogil=True, fastmath={"reassoc"})
def _total(state, first, count):  # type: ignore[no-untyped-def]
    """The sum of state[first : first + count], in any order, so that it is vectorised."""
    total = 0.0
    for n in range(first, first + count):
        total += state[n]
    return total


@njit(cache=True, nogil=True)
def _run(group, first):  # type: ignore[no-untyped-def]
    """The number of pixels from `first` on, at most _LANES, whose groups are equal or consecutive;
    and the step from one group to the next, 0 or 1."""
    last = min(first + _LANES, len(group))
    step = 1
    if first + 1 < last and group[first + 1] == group[first]:
        step = 0
    n = first + 1
    while n < last and group[n] - group[n - 1] == step:
        n += 1
    return n - first, step


@njit(cache=True, nogil=True)
def _emit(state, emitter):  # type: ignore[no-untyped-def]
    """Replaces the drive of the planes of a step by the light of an emitter with time constants."""
    pulse, rise, decay = emitter
    up, down = gone_in(pulse, rise), gone_in(pulse, decay)
    up_after, down_after = gone_in(1.0 - pulse, rise), gone_in(1.0 - pulse, decay)
    for p in range(_LANES):
        glow = state[_GLOW + p]
        for at in range(_LIGHT + p, _LIGHT + p + _PLANES * _LANES, _LANES):
            light, glow = relax(state[at] / pulse, pulse, glow, up, down)
            if pulse < 1.0:
                after, glow = relax(0.0, 1.0 - pulse, glow, up_after, down_after)
                light += after
            state[at] = light
        state[_GLOW + p] = glow


@njit(cache=True, nogil=True)
def _gather(state):  # type: ignore[no-untyped-def]
    """Adds the light of all planes of a step to that of its first."""
    for p in range(_LIGHT, _LIGHT + _LANES):
        total = state[p]
        for k in range(1, _PLANES):
            total += state[p + k * _LANES]
        state[p] = total


def _show(words, cycles, spikes, emitter, span, group, light):  # type: ignore[no-untyped-def]
    """Adds the light of each plane of each pixel to light[plane // span, group[pixel]]. `compiled`
    compiles this kernel for a drive.

    Args:
        words: (words, pixels).
        cycles: number of planes.
        spikes: see `Drive`.
        emitter: `Emitter`.
        span: number of planes in a span.
        group: group of each pixel, (pixels,).
        light: (spans, groups), updated.
    """
    state = np.empty(_LIGHT + _PLANES * _LANES)
    bits = np.zeros(_LANES, np.uint32)
    slow = emitter.rise > 0 or emitter.decay > 0
    first = 0
    while first < words.shape[1]:
        count, step = _run(group, first)
        state[:] = 0.0
        bits[:] = 0
        for n in range(0, cycles, _PLANES):
            for p in range(count):
                bits[p] = words[n >> 5, first + p] >> np.uint32(n & 31)
            for p in range(_LANES):
                tau, age, lit = state[_TAU + p], state[_AGE + p], state[_LIT + p]
                memory, emitted, word = state[_MEMORY + p], state[_EMITTED + p], bits[p]
                for k in range(_PLANES):
                    fired = (word >> np.uint32(k)) & np.uint32(1) == np.uint32(1)
                    age += lit  # lit: 1 from the first spike on
                    after = remember(memory, age, emitted)
                    memory = after if fired else memory
                    tau = age if fired else tau
                    age = 0.0 if fired else age
                    lit = 1.0 if fired else lit
                    x = level(age, max(tau, 1.0), memory)
                    shown = lit if spikes < 2 else min(tau, 1.0)
                    x = x if shown > 0.0 else 0.0
                    emitted = x if fired else emitted + x
                    state[_LIGHT + k * _LANES + p] = x
                state[_TAU + p], state[_AGE + p], state[_LIT + p] = tau, age, lit
                state[_MEMORY + p], state[_EMITTED + p] = memory, emitted
            if slow:
                _emit(state, emitter)
            planes = min(_PLANES, cycles - n)
            if span % _PLANES == 0:  # a step is within a span
                planes = 1
                _gather(state)
            for k in range(planes):
                row, at = light[(n + k) // span], _LIGHT + k * _LANES
                if step == 0:
                    row[group[first]] += _total(state, at, count)
                else:
                    out = row[group[first] : group[first] + count]
                    for p in range(count):
                        out[p] += state[at + p]
        first += count


def panel_light(
    stream: Viform,
    panel: SpikePanel,
    drive: str,
    span: int = 1,
    group: npt.NDArray[np.int64] | None = None,
) -> Values:
    """Light of a panel with this drive, packets Q a cycle, mean over each span and group: (cycles
    // span, groups).

    Args:
        stream: stream from the start, at which the panel is dark.
        panel: the panel.
        drive: name of the drive.
        span: number of planes in a span; planes after the last whole span are ignored.
        group: group of each pixel, (height, width) int from 0 on; by default every pixel is a
            group.

    Raises:
        ValueError: `group` has another size.
    """
    height, width = stream.shape
    groups = np.arange(height * width) if group is None else group.ravel()
    if groups.size != height * width:
        raise ValueError(f"groups must be of {height} x {width} pixels, not {groups.size}")
    cycles = stream.cycles // span * span
    words = stream.words.reshape(len(stream.words), -1)
    scheme, emitter = DRIVES[drive], Emitter.of(replace(panel, drive=drive))
    show = compiled(_show, scheme)

    def part(pixels: slice) -> Values:
        light = np.zeros((cycles // span, int(groups.max()) + 1))
        own = np.ascontiguousarray(words[:, pixels])
        show(own, cycles, scheme.spikes, emitter, span, groups[pixels], light)
        return light

    if cycles * groups.size < _LONG:
        light = part(slice(None))
    else:
        half = groups.size // 2
        with threads(cores()) as pool:
            light, more = pool.map(part, (slice(half), slice(half, None)))
        light += more
    light /= span * np.bincount(groups)
    return light


def every_drive(
    stream: Viform, panel: SpikePanel, span: int = 1, group: npt.NDArray[np.int64] | None = None
) -> dict[str, Values]:
    """`panel_light` for each drive by its name, in parallel."""
    with threads(cores()) as pool:
        lights = pool.map(lambda drive: panel_light(stream, panel, drive, span, group), DRIVES)
        return dict(zip(DRIVES, lights, strict=True))
