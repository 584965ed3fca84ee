"""Cameras without a latch, as the probes of a display use them: their output as planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock, Light, Viform
from cosim.compute.stopping import heed
from cosim.spikes.clocked import Change, HeldPlanes, Reported, latching_cycles
from cosim.spikes.events import mark_planes
from cosim.spikes.held import FINE, held_reports, held_values
from cosim.spikes.viform import Words, words_for
from cosim.stage import Block
from scenarios.assemble.show.feeds import ContinuousFeed
from sensor.asynchronous.machine import AsynchronousMachine
from sensor.asynchronous.model import EventModel, latched
from sensor.asynchronous.pixel.array import AsynchronousPixels
from sensor.asynchronous.readout.recorder import gather_events
from sensor.asynchronous.run import EventSpec
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.run import ContinuousSpec

MOST = 10**9
"""Firings of a probe beyond which it ends; probes are small."""
PART = 4096
"""Cycles of a probe whose firings are in memory together."""


@dataclass(frozen=True)
class EventProbeCamera:
    """Small arrays of asynchronous pixels, every effect kept, without their shared channel;
    implements `ProbeCamera`. It has no row timing.

    Attributes:
        spec: the camera.
        model: rules of a pixel.
    """

    spec: EventSpec
    model: EventModel

    @classmethod
    def of(cls, machine: AsynchronousMachine) -> EventProbeCamera:
        """That of the machine."""
        return cls(machine.spec, machine.spec.model)

    @property
    def clock(self) -> Clock:
        return self.spec.setting.clock

    @property
    def height(self) -> int:
        return self.spec.shape[0]

    @property
    def seed(self) -> int:
        return self.spec.setting.seed

    @property
    def identity(self) -> Any:
        return object()  # its probes are computed in each run

    def lux(self, rate: float) -> float:
        return rate * self.model.threshold * self.clock.hz / self.spec.setting.electrons_per_lux

    def spikes(self, rate: float) -> float:
        pattern, current = self.spec.setting.pattern, rate * self.model.threshold * self.clock.hz
        if pattern is not None:
            current += pattern.dark + pattern.hot * pattern.hot_current
            current += pattern.warm * pattern.warm_current
        forced = PS / self.model.longest if self.model.longest else 0.0
        return current / self.model.threshold + forced

    def row_delays(self, rows: int) -> npt.NDArray[np.int64]:
        return np.zeros(rows, np.int64)

    def film(
        self,
        light: Light,
        cycles: int,
        shape: tuple[int, int],
        seed: int,
        rows: tuple[int, int] | None = None,
    ) -> Viform:
        top, stop = rows or (0, shape[0])
        pixels = AsynchronousPixels(
            replace(self.model, seed=seed), (stop - top, shape[1]),
            self.spec.setting.electrons_per_lux, self.spec.setting.pattern, most=MOST,
        )  # fmt: skip
        if self.model.change > 0:
            return self._held(pixels, light, cycles)
        return self._latched(pixels, light, cycles)

    def _held(self, pixels: AsynchronousPixels, light: Light, cycles: int) -> Viform:
        """The planes of rates that hold until the next event; a part of the cycles at a time."""
        changes = _Fired(pixels, light, self.clock, cycles)
        planes = HeldPlanes(changes, pixels.shape, self.clock, FINE)
        parts = [
            planes.step(None, Block(first, min(PART, cycles - first))).words
            for first in range(0, cycles, PART)
        ]
        return Viform(np.concatenate(parts), cycles, self.clock)

    def _latched(self, pixels: AsynchronousPixels, light: Light, cycles: int) -> Viform:
        """The spikes of a light in the planes of the clock; a part of the cycles at a time, as a
        light of seconds has millions of them."""
        (height, width), tick = pixels.shape, pixels.model.tick
        words: Words = np.zeros((words_for(cycles), height, width), np.uint32)
        for first in range(0, cycles, PART):
            heed()
            stop = min(first + PART, cycles)
            sent = pixels.unordered(light, self.clock.edge(first), self.clock.edge(stop))
            sent = sent.take(sent.level == pixels.model.levels)
            at = (latched(sent.instant, tick) + 1) * tick
            cycle = latching_cycles(at, self.clock, cycles)
            row, column = np.divmod(sent.pixel, np.uint32(width))
            inside = cycle < cycles
            mark_planes(
                words, row[inside].astype(np.uint16), column[inside].astype(np.uint16),
                cycle[inside],
            )  # fmt: skip
        return Viform(words, cycles, self.clock)


class _Fired:
    """The rates of pixels under a light as `Changes`, which fires them as they are asked for."""

    def __init__(self, pixels: AsynchronousPixels, light: Light, clock: Clock, cycles: int) -> None:
        self._pixels, self._light, self._clock, self._cycles = pixels, light, clock, cycles
        none = np.zeros(0, np.int64)
        self._left = none, none, none

    def between(self, start: int, stop: int) -> Sequence[Change]:
        """See `Changes`. What fires in this span may be latched in the next one."""
        heed()
        model, shape, edge = self._pixels.model, self._pixels.shape, self._clock.edge
        fired = self._pixels.step(self._light, edge(start), edge(stop))
        events = gather_events(fired, fired.instant, model, shape, edge(self._cycles))
        new = held_values(events, self._clock, self._cycles)
        cycle, pixel, value = (np.concatenate(both) for both in zip(self._left, new, strict=True))
        later = int(np.searchsorted(cycle, stop))
        self._left = cycle[later:], pixel[later:], value[later:]
        return Reported(cycle[:later], pixel[:later], value[:later]).between(start, stop)


@dataclass(frozen=True)
class ContinuousProbeCamera:
    """Small arrays of continuous pixels, and their planes; implements `ProbeCamera`. It has no row
    timing and no shot noise: a minute of noisy pixels takes minutes, and a report needs a change
    beyond the noise anyway (sensor.continuous.floor).

    Attributes:
        spec: the camera.
        feed: how its reports become planes.
    """

    spec: ContinuousSpec
    feed: ContinuousFeed

    @property
    def clock(self) -> Clock:
        return self.spec.setting.clock

    @property
    def height(self) -> int:
        return self.spec.setting.chip.height

    @property
    def seed(self) -> int:
        return self.spec.camera.seed

    @property
    def identity(self) -> Any:
        return object()  # its probes are computed in each run

    def lux(self, rate: float) -> float:
        current = rate * self.spec.white / self.feed.white_rate
        return current / self.spec.setting.electrons_per_lux

    def spikes(self, rate: float) -> float:
        return 0.0

    def row_delays(self, rows: int) -> npt.NDArray[np.int64]:
        return np.zeros(rows, np.int64)

    def film(
        self,
        light: Light,
        cycles: int,
        shape: tuple[int, int],
        seed: int,
        rows: tuple[int, int] | None = None,
    ) -> Viform:
        setting = self.spec.setting
        chip = replace(setting.chip, height=shape[0], width=shape[1])
        camera = ContinuousCamera(replace(setting, chip=chip, seed=seed, noise=False), rows)
        reports = camera.step(light, 0, self.clock.edge(cycles))
        planes = held_reports(reports, self.spec.white, self.feed.white_rate)
        return planes.step(None, Block(0, cycles))
