"""From photon to photon: how long after an edge of light a display's light passes half way.

Every column of a small chip sees the edge at its own phase of the cycle, every row is driven at its
own time, so the pixels are all phases by all rows. The parts of a pixel's latency add up to it:

- interval: from the edge to the latch of the first spike after it. When light goes, to the first
  latch after it: no spike is the news then.
- readout: from that latch until the panel drives the pixel's row. A panel that drives its rows
  in a smaller share of the cycle than the chip takes to sample them would show rows before they are
  latched; the figure is then negative.
- transport: the panel's.
- hold: from there until the light passes half way between its settled means, emitter and all. A
  panel that holds intervals waits for the second spike here. Light that had gone before the news
  came counts as gone when it comes: 0. That of packets ends with the last of them; that no
  more will follow, an eye can only know after some intervals.

What charge pixels hold at an edge is theirs: out of the dark it is the random one that a run starts
with (or none, with `random initial charge` left out), which is what makes the first interval of
bright light shorter than one threshold needs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock, Viform
from cosim.spikes.viform import unpack_planes
from display.drives import DRIVES
from display.panels.panel import FramePanel, Projector, SpikePanel
from display.probes.camera import ProbeCamera
from display.probes.light import phased_light, settling_cycles
from display.probes.waveform import panel_light
from display.quality.latency import fallen, half_way, risen

__all__ = ["PARTS", "SIDE", "Delay", "Latency", "frame_latency", "spike_latency"]

Values = npt.NDArray[np.float64]
Parts = Sequence[Values | float]
Way = Literal["rise", "fall"]
SIDE: Final = 64
"""Rows and columns (phases) of the chip that is filmed."""
SPARSE: Final = 0.01
"""Spikes a cycle below which the phase within one hardly matters, and so many columns do:"""
FEW: Final = 16
DARK: Final = 6
"""Cycles of darkness before an edge."""
SETTLING: Final = 4
"""Mean intervals that are filmed of light: a panel that holds intervals has settled after two."""
FADING: Final = 3
"""Mean intervals that are filmed after light: causal light is at half after two."""
SPARE: Final = 16
"""Cycles beyond these."""
WAYS: Final[tuple[Way, Way]] = ("rise", "fall")
PARTS: Final = ("interval", "readout", "transport", "hold")


@dataclass(frozen=True)
class Delay:
    """Microseconds, of the pixels that answered."""

    low: float
    median: float
    high: float
    mean: float

    @classmethod
    def of(cls, us: Values) -> Delay:
        """5 %, median, 95 % and mean; all NaN of none."""
        if not us.size:
            return cls(math.nan, math.nan, math.nan, math.nan)
        low, median, high = (float(q) for q in np.percentile(us, [5, 50, 95]))
        return cls(low, median, high, float(us.mean()))


@dataclass(frozen=True)
class Latency:
    """A row of the table.

    Attributes:
        display: its name.
        drive: of a spike panel, else "".
        rate: of the light, spikes a cycle.
        way: dark to light or light to dark.
        total: microseconds.
        parts: of `PARTS`, in order; their means add up to the total's.
        lost: share of pixels whose light never passed half way while it was filmed.
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
    """parts: ps, (pixels,) each, NaN where the light never passed half way."""
    us = np.array(np.broadcast_arrays(*parts)) / (PS / 1e6)
    came = np.isfinite(us).all(axis=0)
    us = us[:, came]
    total, each = Delay.of(us.sum(axis=0)), tuple(Delay.of(part) for part in us)
    return Latency(display, drive, rate, way, total, each, float(1 - came.mean()))


@dataclass(frozen=True, eq=False)
class _Edges:
    """A filmed edge.

    Attributes:
        at: (pixels,) ps, of the edge.
        latch: (pixels,) ps from a clock edge to the latch of each pixel's row.
        cycle: that which holds the edge.
    """

    clock: Clock
    stream: Viform
    rate: float
    way: Way
    at: Values
    latch: Values
    cycle: int

    def news(self) -> Values:
        """(pixels,) ps, end of the cycle that has news of the edge; NaN where none has."""
        origin, cycles = self.cycle - 1, self.stream.cycles  # a late row's window begins earlier
        ends = np.array([self.clock.edge(n + 1) for n in range(origin, cycles)], np.float64)
        news = ends[:, None] + self.latch > self.at
        if self.way == "rise":
            planes = unpack_planes(self.stream.words, origin, cycles)
            news &= planes.reshape(news.shape) > 0
        first = np.argmax(news, axis=0)
        return np.where(news[first, np.arange(len(first))], ends[first], np.nan)


def _film(camera: ProbeCamera, rate: float, way: Way, seed: int, settling: int) -> _Edges:
    """settling: cycles that the emitter takes."""
    phases = SIDE if rate >= SPARSE else FEW
    clock, lux, shape = camera.clock, camera.lux(rate), (SIDE, phases)
    spare = SPARE + settling
    lit = math.ceil(SETTLING / min(rate, 1.0)) + spare
    cycle = DARK if way == "rise" else lit
    after = lit if way == "rise" else math.ceil(FADING / min(rate, 1.0)) + spare
    first, stop = clock.edge(cycle), clock.edge(cycle + 1)
    at = first + (2 * np.arange(phases) + 1) * (stop - first) // (2 * phases)
    cycles = cycle + 1 + after
    levels = (0.0, lux) if way == "rise" else (lux, 0.0)
    light = phased_light(shape, *levels, at, clock.edge(cycles + 2))
    latch = np.repeat(camera.row_delays(SIDE), phases).astype(np.float64)
    stream = camera.film(light, cycles, shape, seed)
    return _Edges(clock, stream, rate, way, np.tile(at, SIDE).astype(np.float64), latch, cycle)


def _one(edges: _Edges, end: Values, panel: SpikePanel, drive: str) -> Latency:
    shape, origin = edges.stream.shape, edges.cycle - 1
    own = replace(panel, shape=shape, drive=drive)
    x = panel_light(edges.stream, replace(own, rise=0.0, decay=0.0), drive)
    lit = slice((edges.cycle + len(x)) // 2, None)
    if edges.way == "fall":
        lit = slice(edges.cycle // 2, edges.cycle)
    half = half_way(0.0, float(x[lit].mean()))
    starts = np.array([panel.start(n) for n in range(origin, len(x) + 1)], np.float64)
    light, pulse = x[origin:], own.share
    if pulse < 1:
        ends = starts[:-1] + pulse * np.diff(starts)
        starts = np.append(np.stack([starts[:-1], ends], axis=1).ravel(), starts[-1])
        light = np.stack([light / pulse, np.zeros_like(light)], axis=1).reshape(-1, light.shape[1])
    if edges.way == "fall" and own.rise > 0:  # the emitter has settled before
        starts = np.append(starts[0] - 1e3 * own.rise * PS, starts)
        light = np.concatenate([np.full((1, light.shape[1]), 2 * half), light])
    passed = risen if edges.way == "rise" else fallen
    row = np.repeat(np.arange(shape[0]), shape[1]) * (own.row_delay / shape[0])
    when = passed(starts, light, half, own.rise * PS, own.decay * PS) + row
    hold = when - (end + panel.transport + row)
    if edges.way == "fall":
        hold = np.maximum(hold, 0.0)
    parts = end + edges.latch - edges.at, row - edges.latch, float(panel.transport), hold
    return _row("spike", drive, edges.rate, edges.way, parts)


def spike_latency(
    camera: ProbeCamera, panel: SpikePanel, rates: Sequence[float], seed: int
) -> list[Latency]:
    """Every drive of a panel at these lights (spikes a cycle), on and off."""
    rows: list[Latency] = []
    for rate in rates:
        for way in WAYS:
            edges = _film(camera, rate, way, seed, settling_cycles(panel))
            end = edges.news()
            with ThreadPoolExecutor() as pool:
                rows += pool.map(partial(_one, edges, end, panel), DRIVES)
    return rows


def _frame(panel: FramePanel, way: Way) -> Parts:
    """Edges at every phase of a frame; light is taken at its start and is news then. A strobe is
    a packet a frame: on with the first that reaches half of the mean, off with the last."""
    frame = 1 / panel.rate.hz
    wait = (np.arange(SIDE * SIDE) + 0.5) / (SIDE * SIDE) * frame
    lit = panel.persistence * frame
    if way == "rise":
        hold = -panel.response * math.log1p(-panel.persistence / 2)
        if hold % frame >= lit:  # it passes between two flashes
            hold += frame - hold % frame
    else:
        hold = panel.response * math.log(2 / panel.persistence)
        hold = math.floor(hold / frame) * frame + min(hold % frame, lit)
    return wait, 0.0, panel.latency, np.full(wait.shape, hold)


def _projector(panel: Projector, level: float, way: Way) -> Parts:
    """Edges at every phase of a plane; errors of the pixels are spread evenly. On, the news is the
    first plane that is lit; off, the first that samples the dark."""
    plane = 1 / panel.rate.hz
    phase, error = np.meshgrid(*[(np.arange(SIDE) + 0.5) / SIDE] * 2)
    wait = phase.ravel() * plane
    if way == "rise":  # an error of -1/2 to 1/2 that grows by the level until it is 1/2
        wait = wait + (np.ceil((1 - error.ravel()) / level) - 1) * plane
    return wait, 0.0, panel.latency, np.zeros(wait.shape)


def frame_latency(
    panel: FramePanel | Projector, white_rate: float, rates: Sequence[float]
) -> list[Latency]:
    """A panel of frames fed the true light. white_rate: the light that it shows as white."""
    rows = []
    for rate in rates:
        for way in WAYS:
            if isinstance(panel, Projector):
                parts = _projector(panel, min(rate / white_rate, 1.0), way)
            else:
                parts = _frame(panel, way)
            rows.append(_row(panel.name, "", rate, way, [part * PS for part in parts]))
    return rows
