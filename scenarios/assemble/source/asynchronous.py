"""Assembles the asynchronous camera of a scenario, with its scene and lens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock, Events, InputError, Light, Viform, seconds_to_ps
from cosim.compute.stopping import heed
from cosim.config.amounts import at_least, number
from cosim.config.quantity import FASTEST
from cosim.config.toml import to_toml
from cosim.run.machine import Outcome, Recording
from cosim.spikes.clocked import (
    FINE,
    Change,
    ClockedEvents,
    HeldPlanes,
    Reported,
    held_events,
    held_values,
    latching_cycles,
)
from cosim.spikes.events import mark_planes, only_full
from cosim.spikes.viform import Words, words_for
from cosim.stage import Block
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.instants import choose_instants
from scenarios.assemble.lens import choose_lens, make_relay
from scenarios.assemble.pixel_kinds import refuse_keys, with_section
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.feeds import THRESHOLD, Feed, Planes
from scenarios.scenes.kinds.grid import SceneGrid
from sensor import CameraSetting
from sensor.asynchronous.machine import AsynchronousMachine
from sensor.asynchronous.model import EventModel, latched
from sensor.asynchronous.pixel.array import AsynchronousPixels
from sensor.asynchronous.readout.recorder import gather_events
from sensor.asynchronous.run import EventSpec
from sensor.asynchronous.setting import event_camera
from sensor.asynchronous.study import AsynchronousStudy
from sensor.sections.unlatched import AsynchronousSection

MOST = 10**9
"""Firings of a probe beyond which it ends; probes are small."""
PART = 4096
"""Cycles of a probe whose firings are in memory together."""


def with_defaults(scenario: Scenario) -> Scenario:
    """The scenario with [sensor.asynchronous] written out."""
    return with_section(scenario, "asynchronous", AsynchronousSection())


def assemble_asynchronous(name: str, scenario: Scenario) -> AsynchronousMachine:
    """The machine of a scenario. Raises InputError."""
    return AsynchronousMachine.begin(_spec(name, scenario))


def study_asynchronous(name: str, scenario: Scenario) -> AsynchronousStudy:
    """The same camera for `viform plan` and `viform accuracy`. Raises InputError."""
    return AsynchronousStudy(_spec(name, scenario))


def _spec(name: str, scenario: Scenario) -> EventSpec:
    scenario = with_defaults(scenario)
    setting = event_setting(scenario)
    camera = event_camera(scenario.sensor, setting, scenario.tolerance)
    stop, tick = seconds_to_ps(scenario.duration), camera.model.tick
    if stop < tick:
        raise InputError(
            "duration", f"at least one period of the timing clock, {tick} ps", f"{stop} ps",
            "lengthen it",
        )  # fmt: skip
    cycles = setting.clock.cycle_at(stop - 1) + 1
    choice = choose_lens(scenario, setting)
    lens, chosen = choice.lens, scenario.sensor.lens.f_number is None
    shape = (setting.chip.height, setting.chip.width)
    source = scenario.scene.source(SceneGrid(shape, setting.clock, cycles, aligned=False))
    targets = getattr(source, "targets", [])
    return EventSpec(
        name=name,
        title=scenario.title,
        toml=to_toml(scenario),
        inputs=to_toml(scenario.model_copy(update={"title": ""})),
        tolerance=scenario.tolerance,
        section=scenario.sensor,
        setting=setting,
        camera=camera,
        lens=lens,
        relay=make_relay(lens, setting),
        illuminance=scenario.scene.illuminance,
        source=source,
        duration=scenario.duration,
        instants=[] if targets else choose_instants(scenario, cycles),
        # These pixels do not saturate: of the lens's notes only the chosen f-number applies.
        notes=choice.notes[:1] if chosen else [],
    )


def event_setting(scenario: Scenario) -> CameraSetting:
    """Chip, light and device as for any camera; the array has the size that the scenario sets.
    Raises InputError for keys that only latched pixels have."""
    sensor = scenario.sensor
    section = sensor.asynchronous or AsynchronousSection()
    refuse_keys(
        "asynchronous",
        (
            ("reset", sensor.reset, "residual"),
            ("threshold_noise", sensor.threshold_noise, 0),
            ("capacitance", sensor.capacitance, None),
            ("row_skew", sensor.row_skew, 0),
        ),
        "leave it out: these pixels fire at their threshold and restart from zero charge",
    )
    return camera_setting(scenario, section.height, section.width)


class EventFeed(Feed):
    """The events of asynchronous pixels."""

    def __init__(self, scenario: Scenario, machine: AsynchronousMachine) -> None:
        spec = machine.spec
        clock = spec.setting.clock
        rate = (
            spec.illuminance * spec.lens.gain * spec.setting.electrons_per_lux
            / (spec.model.threshold * clock.hz)
        )  # fmt: skip
        self._rate = rate
        self._tone = tone = None if scenario.display is None else scenario.display.mapped
        if tone is None and rate * clock.hz > FASTEST:
            raise InputError(
                "display", f"absent where white fires at {rate * clock.hz:.3g} Hz, more than a "
                "spike a cycle of the fastest sensor.clock", "given",
                "set display.tone=log, leave it out, raise sensor.threshold, or close the lens "
                "(sensor.lens.f_number)",
            )  # fmt: skip
        if tone is None and rate > 1:
            raise InputError(
                "sensor.clock",
                f"at least {at_least(rate * clock.hz, 4)} Hz with a [display]: white must "
                "fire at most once a cycle", f"{clock.hz:g} Hz",
                "raise it or sensor.threshold, set display.tone=log, or close the lens "
                "(sensor.lens.f_number)",
            )  # fmt: skip
        self._changes = spec.model.change > 0
        told = "the width of an event, held until the next" if self._changes else "as it fires"
        mapped = "" if tone is None else f"; {tone.told(rate)}"
        # Held planes have no noise of a threshold.
        own = spec.model.threshold if tone is None and not self._changes else THRESHOLD
        super().__init__(
            spec.shape, clock, spec.cycles, rate if tone is None else tone.white,
            f"the scene's white, {number(rate)} spikes a cycle: {told}{mapped}",
            scenario.scene, own, tone=tone,
        )  # fmt: skip
        self._machine = machine

    def probe_camera(self) -> EventProbeCamera | None:
        if self._tone is not None:  # its planes are not those of a camera's rates
            return None
        return EventProbeCamera.of(self._machine)

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """See `Feed`."""
        events: Events = outcome.views.events
        if self._tone is not None:
            share, white = self._tone.share, self._rate
            return Planes(
                held_events(events, self.clock, self.cycles, lambda rate: share(rate / white))
            )
        if self._changes:
            return Planes(held_events(events, self.clock, self.cycles))
        full, partial = only_full(events)
        return Planes(ClockedEvents(full, self.clock, self.cycles), partial=partial)


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
        """The probe camera with the pixels of the machine."""
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
