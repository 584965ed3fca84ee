"""The light of a spike-continuous panel, pixel by pixel over time, in compiled code.

It has the same drives and the same emitter as `GoldenRenderer`, with which a test compares it, but
another order: all planes of one pixel, then the next pixel. Long waveforms of few pixels and sums
over a patch are then fast.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Viform
from display.drives import DRIVES
from display.drives.compiled import compiled, level, remember
from display.panels.emitter import Emitter, gone_in, relax
from display.panels.panel import SpikePanel

__all__ = ["every_drive", "panel_light"]

_LINE: Final = 4096
"""Number of planes of a pixel in a line."""
_SHORT: Final = 8
"""Number of planes written in one loop of constant length; grey has shorter intervals."""
_LONG: Final = 10**8
"""Number of pixel-planes from which on two threads share the pixels."""
_DE_BRUIJN: Final = np.uint32(0x077CB531)
_PLACES: Final = np.array(
    [0, 1, 28, 2, 29, 14, 24, 3, 30, 22, 20, 15, 25, 17, 4, 8,
     31, 27, 13, 23, 21, 19, 16, 7, 26, 12, 18, 6, 11, 5, 10, 9]
)  # fmt: skip
"""Position of the only set bit of a word, by the top five bits of its product with a de Bruijn
sequence (Leiserson, Prokop and Randall, 1998)."""
Values = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def _next_spike(words, pixel, n, stop):  # type: ignore[no-untyped-def]
    """The first plane from n on in which the pixel fires, or `stop`."""
    while n < stop:
        word = words[pixel, n >> 5] >> np.uint32(n & 31)
        if word:
            lowest = word & (~word + np.uint32(1))
            return min(n + _PLACES[np.uint32(lowest * _DE_BRUIJN) >> np.uint32(27)], stop)
        n = (n | 31) + 1
    return stop


@njit(cache=True, nogil=True, fastmath={"reassoc"})
def _total(line, first, stop):  # type: ignore[no-untyped-def]
    """The sum of line[first:stop], in any order, so that it is vectorised."""
    total = 0.0
    for n in range(first, stop):
        total += line[n]
    return total


@njit(cache=True, nogil=True)
def _add_sums(line, count, span, row):  # type: ignore[no-untyped-def]
    """Adds the sum of each span of the line to `row`. Every sum is in order; four sums are
    interleaved, because a single one would wait for each addition."""
    spans = count // span
    four = spans // 4 * 4
    for n in range(0, four, 4):
        k = n * span
        a = b = c = d = 0.0
        for at in range(k, k + span):
            a += line[at]
            b += line[at + span]
            c += line[at + 2 * span]
            d += line[at + 3 * span]
        row[n] += a
        row[n + 1] += b
        row[n + 2] += c
        row[n + 3] += d
    for n in range(four, spans):
        a = 0.0
        for at in range(n * span, (n + 1) * span):
            a += line[at]
        row[n] += a


def _show(words, cycles, spikes, emitter, span, group, light):  # type: ignore[no-untyped-def]
    """Adds the light of each plane of each pixel to light[group[pixel], plane // span]. `compiled`
    compiles this kernel for a drive. The drive of a pixel is written from spike to spike to a line
    that fits into the cache.

    Args:
        words: (pixels, words), so that the words of a pixel are contiguous.
        cycles: number of planes.
        spikes: see `Drive`.
        emitter: `Emitter`.
        span: number of planes in a span.
        group: group of each pixel, (pixels,).
        light: (groups, spans), updated.
    """
    pulse, rise, decay = emitter
    reach = max(_LINE // span, 1) * span
    line = np.empty(reach + _SHORT)
    slow = rise > 0 or decay > 0
    up, down = gone_in(pulse, rise), gone_in(pulse, decay)
    up_after, down_after = gone_in(1.0 - pulse, rise), gone_in(1.0 - pulse, decay)
    for pixel in range(words.shape[0]):
        row = light[group[pixel]]
        tau, age, memory, emitted, glow = 1.0, 0.0, 0.0, 0.0, 0.0
        count, lit = 0, False  # lit: between spikes
        for first in range(0, cycles, reach):
            stop = min(first + reach, cycles)
            n = first
            while n < stop:
                m = _next_spike(words, pixel, n, stop)
                at = n - first
                # At least _SHORT planes: the next spike overwrites the excess. A loop of constant
                # length is much faster than a short variable one.
                if lit:
                    for k in range(_SHORT):
                        line[at + k] = level(age + 1.0 + k, tau, memory)
                    for k in range(_SHORT, m - n):
                        line[at + k] = level(age + 1.0 + k, tau, memory)
                else:
                    for k in range(_SHORT):
                        line[at + k] = 0.0
                    for k in range(_SHORT, m - n):
                        line[at + k] = 0.0
                age += m - n
                emitted += _total(line, at, m - first)
                if m < stop:
                    age += 1.0
                    memory = remember(memory, age if count > 0 else 0.0, emitted)
                    if count > 0:
                        tau = age
                    age = 0.0
                    if count < 2:
                        count += 1
                        lit = 0 < spikes <= count
                    emitted = level(age, tau, memory) if count >= spikes else 0.0
                    line[m - first] = emitted
                n = m + 1
            if slow:
                for k in range(stop - first):
                    total, glow = relax(line[k] / pulse, pulse, glow, up, down)
                    if pulse < 1.0:
                        after, glow = relax(0.0, 1.0 - pulse, glow, up_after, down_after)
                        total += after
                    line[k] = total
            slot = first // span
            if span == 1:
                for k in range(stop - first):
                    row[slot + k] += line[k]
            else:
                _add_sums(line, stop - first, span, row[slot:])


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
    words = np.ascontiguousarray(stream.words.reshape(len(stream.words), -1).T)
    scheme, emitter = DRIVES[drive], Emitter.of(replace(panel, drive=drive))
    show = compiled(_show, scheme)

    def part(pixels: slice) -> Values:
        light = np.zeros((int(groups.max()) + 1, cycles // span))
        show(words[pixels], cycles, scheme.spikes, emitter, span, groups[pixels], light)
        return light

    if cycles * groups.size < _LONG:
        light = part(slice(None))
    else:
        half = groups.size // 2
        with ThreadPoolExecutor() as pool:
            light, more = pool.map(part, (slice(half), slice(half, None)))
        light += more
    light /= (span * np.bincount(groups))[:, None]
    return light.T


def every_drive(
    stream: Viform, panel: SpikePanel, span: int = 1, group: npt.NDArray[np.int64] | None = None
) -> dict[str, Values]:
    """`panel_light` for each drive by its name, in parallel."""
    with ThreadPoolExecutor() as pool:
        lights = pool.map(lambda drive: panel_light(stream, panel, drive, span, group), DRIVES)
        return dict(zip(DRIVES, lights, strict=True))
