"""Measures the photon-to-photon latency: the time from a step of light until the light of a display
crosses half of the step.

In a small array, each column has the step at another phase of the cycle, and each row is driven at
another time, so the pixels cover all phases and rows. The parts of a pixel's latency add up to it:

- interval: from the step to the latch of the first spike after it. For falling light, to the first
  latch after it, because the absence of a spike carries the information.
- readout: from that latch until the panel drives the row. If the panel drives its rows in a smaller
  share of the cycle than the chip samples them, it would show rows before they are latched; this
  part is then negative.
- transport: delay of the panel.
- hold: from there until the light crosses half of the step between its settled means, including the
  emitter. A panel that holds intervals waits for the second spike. If the light has fallen before
  the information arrives, this part is 0. The light of packets ends with the last packet; an eye
  can only notice the end after some intervals.

The initial charge of the pixels is that of the run: in the dark it is random (or zero without the
effect `random initial charge`), so the first interval of bright light is shorter than the time for
a whole threshold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock, Viform
from cosim.compute.cores import cores
from cosim.compute.stopping import threads
from cosim.spikes.viform import unpack_planes
from display.drives import DRIVES
from display.panels.panel import FramePanel, Projector, SpikePanel
from display.probes.setup import ProbeCamera, phased_light, settling_cycles, too_much
from display.probes.waveform import panel_light
from display.quality.edges import fallen, half_way, risen

Values = npt.NDArray[np.float64]
Parts = Sequence[Values | float]
Way = Literal["rise", "fall"]
SIDE: Final = 64
"""Numbers of rows and columns (phases) of the recorded array."""
SPARSE: Final = 0.01
"""Rate below which the phase hardly matters and FEW columns are sufficient, spikes a cycle."""
FEW: Final = 16
DARK: Final = 6
"""Number of dark cycles before a step."""
SETTLING: Final = 4
"""Recorded time with light, mean intervals: a panel that holds intervals settles after two."""
FADING: Final = 3
"""Recorded time after light, mean intervals: causal light reaches half after two."""
SPARE: Final = 16
"""Number of additional cycles."""
WAYS: Final[tuple[Way, Way]] = ("rise", "fall")
PARTS: Final = ("interval", "readout", "transport", "hold")


@dataclass(frozen=True)
class Delay:
    """Statistics of a time over the pixels that respond, µs.

    Attributes:
        low, median, high: 5 %, 50 % and 95 % quantiles.
        mean: mean.
    """

    low: float
    median: float
    high: float
    mean: float

    @classmethod
    def of(cls, us: Values) -> Delay:
        """The statistics of the times `us`; NaN for an empty array."""
        if not us.size:
            return cls(math.nan, math.nan, math.nan, math.nan)
        low, median, high = (float(q) for q in np.percentile(us, [5, 50, 95]))
        return cls(low, median, high, float(us.mean()))


@dataclass(frozen=True)
class Latency:
    """The latency of one display at one light.

    Attributes:
        display: name of the display.
        drive: drive of a spike panel, else "".
        rate: light after or before the step, spikes a cycle.
        way: "rise" from dark to light, or "fall".
        total: total latency.
        parts: parts in the order of `PARTS`; their means add up to that of the total.
        lost: share of pixels whose light does not cross half within the recorded time.
        unit: unit of the times.
    """

    display: str
    drive: str
    rate: float
    way: Way
    total: Delay
    parts: tuple[Delay, ...]
    lost: float
    unit: str = "us"


def _row(display: str, drive: str, rate: float, way: Way, parts: Parts) -> Latency:
    """The row for `parts`, ps, each (pixels,), NaN for pixels that do not respond."""
    us = np.array(np.broadcast_arrays(*parts)) / (PS / 1e6)
    responds = np.isfinite(us).all(axis=0)
    us = us[:, responds]
    total, each = Delay.of(us.sum(axis=0)), tuple(Delay.of(part) for part in us)
    return Latency(display, drive, rate, way, total, each, float(1 - responds.mean()))


@dataclass(frozen=True, eq=False)
class _Edges:
    """A recorded step.

    Attributes:
        clock: latch clock.
        stream: recorded stream.
        rate: light, spikes a cycle.
        way: "rise" or "fall".
        at: instant of the step, ps, (pixels,).
        latch: delay from a clock edge to the latch of the pixel's row, ps, (pixels,).
        cycle: cycle that contains the step.
    """

    clock: Clock
    stream: Viform
    rate: float
    way: Way
    at: Values
    latch: Values
    cycle: int

    def response(self) -> Values:
        """End of the first cycle that depends on the step, ps, (pixels,); NaN without one."""
        origin, cycles = self.cycle - 1, self.stream.cycles  # windows of delayed rows begin earlier
        ends = np.array([self.clock.edge(n + 1) for n in range(origin, cycles)], np.float64)
        after = ends[:, None] + self.latch > self.at
        if self.way == "rise":
            planes = unpack_planes(self.stream.words, origin, cycles)
            after &= planes.reshape(after.shape) > 0
        first = np.argmax(after, axis=0)
        return np.where(after[first, np.arange(len(first))], ends[first], np.nan)


def _phases(rate: float) -> int:
    """Number of columns."""
    return SIDE if rate >= SPARSE else FEW


def _cycles(rate: float, way: Way, settling: int) -> tuple[int, int]:
    """The cycle of the step, and the length of the recording, cycles."""
    spare = SPARE + settling
    lit = math.ceil(SETTLING / min(rate, 1.0)) + spare
    cycle = DARK if way == "rise" else lit
    after = lit if way == "rise" else math.ceil(FADING / min(rate, 1.0)) + spare
    return cycle, cycle + 1 + after


def _film(camera: ProbeCamera, rate: float, way: Way, seed: int, settling: int) -> _Edges:
    """Records a step; `settling` is the settling time of the emitter, cycles."""
    phases = _phases(rate)
    clock, lux, shape = camera.clock, camera.lux(rate), (SIDE, phases)
    cycle, cycles = _cycles(rate, way, settling)
    first, stop = clock.edge(cycle), clock.edge(cycle + 1)
    at = first + (2 * np.arange(phases) + 1) * (stop - first) // (2 * phases)
    levels = (0.0, lux) if way == "rise" else (lux, 0.0)
    light = phased_light(shape, *levels, at, clock.edge(cycles + 2))
    latch = np.repeat(camera.row_delays(SIDE), phases).astype(np.float64)
    stream = camera.film(light, cycles, shape, seed)
    return _Edges(clock, stream, rate, way, np.tile(at, SIDE).astype(np.float64), latch, cycle)


def _one(edges: _Edges, end: Values, panel: SpikePanel, drive: str) -> Latency:
    """The latency for one drive. `end`: `_Edges.response`, ps."""
    shape, origin = edges.stream.shape, edges.cycle - 1
    small = replace(panel, shape=shape, drive=drive)
    x = panel_light(edges.stream, replace(small, rise=0.0, decay=0.0), drive)
    lit = slice((edges.cycle + len(x)) // 2, None)
    if edges.way == "fall":
        lit = slice(edges.cycle // 2, edges.cycle)
    half = half_way(0.0, float(x[lit].mean()))
    starts = np.array([panel.start(n) for n in range(origin, len(x) + 1)], np.float64)
    light, pulse = x[origin:], small.share
    if pulse < 1:
        ends = starts[:-1] + pulse * np.diff(starts)
        starts = np.append(np.stack([starts[:-1], ends], axis=1).ravel(), starts[-1])
        light = np.stack([light / pulse, np.zeros_like(light)], axis=1).reshape(-1, light.shape[1])
    if edges.way == "fall" and small.rise > 0:  # the emitter is settled at the start
        starts = np.append(starts[0] - 1e3 * small.rise * PS, starts)
        light = np.concatenate([np.full((1, light.shape[1]), 2 * half), light])
    passed = risen if edges.way == "rise" else fallen
    row = np.repeat(np.arange(shape[0]), shape[1]) * (small.row_delay / shape[0])
    when = passed(starts, light, half, small.rise * PS, small.decay * PS) + row
    hold = when - (end + panel.transport + row)
    if edges.way == "fall":
        hold = np.maximum(hold, 0.0)
    parts = end + edges.latch - edges.at, row - edges.latch, float(panel.transport), hold
    return _row("spike", drive, edges.rate, edges.way, parts)


def spike_latency(
    camera: ProbeCamera, panel: SpikePanel, rates: Sequence[float], seed: int
) -> list[Latency]:
    """The latency for every drive of a panel, rising and falling; NaN where
    `too_much`.

    Args:
        camera, panel: camera and panel.
        rates: lights, spikes a cycle.
        seed: seed of the noise.
    """
    rows: list[Latency] = []
    for rate in rates:
        for way in WAYS:
            cycles = _cycles(rate, way, settling_cycles(panel))[1]
            if too_much(camera, rate, cycles, SIDE * _phases(rate)):
                nothing = [math.nan] * len(PARTS)
                rows += [_row("spike", drive, rate, way, nothing) for drive in DRIVES]
                continue
            edges = _film(camera, rate, way, seed, settling_cycles(panel))
            end = edges.response()
            with threads(cores()) as pool:
                rows += pool.map(partial(_one, edges, end, panel), DRIVES)
    return rows


def _frame(panel: FramePanel, way: Way) -> Parts:
    """The parts for a frame panel, s, with steps at all phases of a frame, which samples the light
    at its start. A strobe emits one packet in each frame: it has risen with the first packet that
    reaches half of the mean, and fallen after the last."""
    frame = 1 / panel.rate.hz
    wait = (np.arange(SIDE * SIDE) + 0.5) / (SIDE * SIDE) * frame
    lit = panel.persistence * frame
    if way == "rise":
        hold = -panel.response * math.log1p(-panel.persistence / 2)
        if hold % frame >= lit:  # the crossing is between two flashes
            hold += frame - hold % frame
    else:
        hold = panel.response * math.log(2 / panel.persistence)
        hold = math.floor(hold / frame) * frame + min(hold % frame, lit)
    return wait, 0.0, panel.latency, np.full(wait.shape, hold)


def _projector(panel: Projector, level: float, way: Way) -> Parts:
    """The parts for a projector, s, with steps at all phases of a plane and uniformly distributed
    errors. Light has risen with the first plane that is on, and fallen with the first one that
    samples the dark."""
    plane = 1 / panel.rate.hz
    phase, error = np.meshgrid(*[(np.arange(SIDE) + 0.5) / SIDE] * 2)
    wait = phase.ravel() * plane
    if way == "rise":  # the error starts at -1/2 to 1/2 and grows by the level up to 1/2
        wait = wait + (np.ceil((1 - error.ravel()) / level) - 1) * plane
    return wait, 0.0, panel.latency, np.zeros(wait.shape)


def frame_latency(
    panel: FramePanel | Projector, white_rate: float, rates: Sequence[float]
) -> list[Latency]:
    """The latency of a reference panel that shows the true light.

    Args:
        panel: the reference panel.
        white_rate: light that it shows as white, spikes a cycle.
        rates: lights, spikes a cycle.
    """
    rows = []
    for rate in rates:
        for way in WAYS:
            if isinstance(panel, Projector):
                parts = _projector(panel, min(rate / white_rate, 1.0), way)
            else:
                parts = _frame(panel, way)
            rows.append(_row(panel.name, "", rate, way, [part * PS for part in parts]))
    return rows
