"""Assembles the asynchronous camera of a scenario, with its scene and lens."""

from __future__ import annotations

from cosim import InputError, seconds_to_ps
from cosim.config.toml import to_toml
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.instants import choose_instants
from scenarios.assemble.lens import choose_lens, make_relay
from scenarios.assemble.readout import refuse_keys, with_section
from scenarios.assemble.schema.scenario import Scenario
from scenarios.scenes.kinds.grid import SceneGrid
from sensor import CameraSetting
from sensor.asynchronous.machine import AsynchronousMachine
from sensor.asynchronous.run import EventSpec
from sensor.asynchronous.setting import event_camera
from sensor.asynchronous.study.study import AsynchronousStudy
from sensor.sections.unlatched import AsynchronousSection


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
