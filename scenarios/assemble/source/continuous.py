"""Assembles the continuous camera of a scenario, with its scene and lens."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Clock, InputError, Light, Viform, seconds_to_ps
from cosim.config.amounts import at_least
from cosim.config.quantity import DAY
from cosim.config.toml import to_toml
from cosim.run.machine import Outcome, Recording
from cosim.spikes.clocked import held_reports
from cosim.stage import Block
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.instants import choose_instants
from scenarios.assemble.lens import choose_lens, make_relay
from scenarios.assemble.pixel_kinds import refuse_keys, with_section
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.feeds import Feed, Planes
from scenarios.scenes.kinds.grid import SceneGrid
from sensor import CameraSetting
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.machine import ContinuousMachine
from sensor.continuous.run import ContinuousSpec, intensity_camera
from sensor.continuous.study import ContinuousStudy
from sensor.sections.unlatched import ContinuousSection


def with_defaults(scenario: Scenario) -> Scenario:
    """The scenario with [sensor.continuous] written out."""
    return with_section(scenario, "continuous", ContinuousSection())


def assemble_continuous(name: str, scenario: Scenario) -> ContinuousMachine:
    """The machine of a scenario. Raises InputError."""
    return ContinuousMachine.begin(_spec(name, scenario))


def study_continuous(name: str, scenario: Scenario) -> ContinuousStudy:
    """The study of a scenario for `viform plan` and `viform accuracy`. Raises InputError."""
    return ContinuousStudy(_spec(name, scenario))


def _spec(name: str, scenario: Scenario) -> ContinuousSpec:
    """The camera of a scenario, its scene and its lens."""
    scenario = with_defaults(scenario)
    section = scenario.sensor.continuous
    assert section is not None
    camera = continuous_chip(scenario)
    image = scenario.image
    pixels = intensity_camera(section, camera, scenario.tolerance, image.window, image.floor)
    clock, chip = pixels.setting.clock, pixels.setting.chip
    cycles = clock.cycles_in(seconds_to_ps(scenario.duration))
    if not cycles and clock.hz * DAY < 1:
        raise InputError(
            "sensor.clock", f"at least {at_least(1 / DAY)} Hz, a cycle in the longest duration",
            f"{clock.hz:g} Hz", "raise it",
        )  # fmt: skip
    if not cycles:
        raise InputError(
            "duration", f"at least {at_least(1 / clock.hz)} s, one cycle",
            f"{scenario.duration:g} s", "lengthen it",
        )  # fmt: skip
    instants = choose_instants(scenario, cycles)
    lens = choose_lens(scenario, camera).lens
    source = scenario.scene.source(
        SceneGrid((chip.height, chip.width), clock, cycles, aligned=False)
    )
    return ContinuousSpec(
        name=name,
        title=scenario.title,
        toml=to_toml(scenario),
        inputs=to_toml(scenario.model_copy(update={"title": ""})),
        section=scenario.sensor,
        camera=camera,
        pixels=pixels,
        lens=lens,
        relay=make_relay(lens, camera),
        illuminance=scenario.scene.illuminance,
        source=source,
        cycles=cycles,
        instants=instants,
    )


def continuous_chip(scenario: Scenario) -> CameraSetting:
    """Chip, light and device as for any camera; the array has the size that the scenario sets.
    Raises InputError for keys that only spiking pixels have."""
    sensor = scenario.sensor
    section = sensor.continuous or ContinuousSection()
    refuse_keys(
        "continuous",
        (
            ("reset", sensor.reset, "residual"),
            ("threshold_noise", sensor.threshold_noise, 0),
            ("capacitance", sensor.capacitance, None),
            ("dead_time", sensor.dead_time, 0),
            ("comparator_delay", sensor.comparator_delay, 0),
            ("row_skew", sensor.row_skew, 0),
        ),
        "leave it out: these pixels do not spike (their keys are in sensor.continuous)",
    )
    return camera_setting(scenario, section.height, section.width)


class ContinuousFeed(Feed):
    """The reports of continuous pixels."""

    def __init__(self, scenario: Scenario, machine: ContinuousMachine) -> None:
        spec = machine.spec
        rate, chip = spec.section.lens.white_rate, spec.setting.chip
        self._white = spec.white
        self._tone = tone = None if scenario.display is None else scenario.display.mapped
        mapped = "" if tone is None else f"; {tone.told(rate)}"
        super().__init__(
            (chip.height, chip.width), spec.setting.clock, spec.cycles,
            rate if tone is None else tone.white,
            f"the scene's white, {spec.white:.3g} electrons/s, fires at sensor.lens.white_rate = "
            f"{rate:g}{mapped}", scenario.scene, tone=tone,
        )  # fmt: skip
        self._spec = spec

    def probe_camera(self) -> ContinuousProbeCamera | None:
        if self._tone is not None:  # its planes are not those of a camera's rates
            return None
        return ContinuousProbeCamera(self._spec, self)

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """See `Feed`."""
        shown = None if self._tone is None else self._tone.share
        rate = self.white_rate if shown is None else 1.0
        return Planes(held_reports(outcome.views.reports, self._white, rate, shown))


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
