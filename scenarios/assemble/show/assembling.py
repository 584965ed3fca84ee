"""Puts the display of a scenario behind the machine of its source."""

from __future__ import annotations

from typing import Any, Final

from cosim import Clock
from cosim.run.machine import Machine
from display.probes.camera import ProbeCamera
from display.section import DisplaySection
from rtl_model.imagers.machine import ImagerMachine
from scenarios.assemble.instants import even_instants
from scenarios.assemble.recording.machine import RecordingMachine
from scenarios.assemble.schema.scenario import (
    ImagerScenario,
    ImageSection,
    RecordingScenario,
    Scenario,
)
from scenarios.assemble.show.feeds import (
    ContinuousFeed,
    EventFeed,
    Feed,
    FrameFeed,
    RecordedFeed,
)
from scenarios.assemble.show.machine import ShownMachine
from scenarios.assemble.show.playing import make_playing
from scenarios.assemble.show.probes import ContinuousProbeCamera, EventProbeCamera
from scenarios.scenes.kinds.grid import SceneGrid
from sensor.asynchronous.machine import AsynchronousMachine
from sensor.continuous.machine import ContinuousMachine

__all__ = ["show_continuous", "show_events", "show_frames", "show_recording"]

PLANES: Final = 40e3
"""Planes a second for the frames of an imager, unless display.clock says otherwise."""


def show_events(scenario: Scenario, machine: AsynchronousMachine) -> Machine:
    """An asynchronous camera with the display of its scenario, if it has one."""
    if scenario.display is None:
        return machine
    return _shown(
        scenario, scenario.display, machine, EventFeed(machine), EventProbeCamera.of(machine)
    )


def show_continuous(scenario: Scenario, machine: ContinuousMachine) -> Machine:
    """A continuous camera with the display of its scenario, if it has one."""
    if scenario.display is None:
        return machine
    feed = ContinuousFeed(machine)
    return _shown(
        scenario, scenario.display, machine, feed, ContinuousProbeCamera(machine.spec, feed)
    )


def show_frames(scenario: ImagerScenario, machine: ImagerMachine) -> Machine:
    """An imager with the display of its scenario, if it has one."""
    if scenario.display is None:
        return machine
    clock = Clock.from_hz(scenario.display.clock or PLANES)
    lux = scenario.scene.illuminance * machine.planned.view.gain
    return _shown(scenario, scenario.display, machine, FrameFeed(machine, clock, lux), None)


def show_recording(scenario: RecordingScenario, machine: RecordingMachine) -> Machine:
    """A recorded stream with the display of its scenario, if it has one."""
    if scenario.display is None:
        return machine
    return _shown(scenario, scenario.display, machine, RecordedFeed(machine), None)


def _shown(
    scenario: Scenario | ImagerScenario | RecordingScenario,
    section: DisplaySection,
    machine: Machine,
    feed: Feed,
    probe: ProbeCamera | None,
) -> ShownMachine:
    """Raises InputError for a display or a camera that does not fit."""
    scene: Any = getattr(scenario, "scene", None)
    grid = SceneGrid(feed.shape, feed.clock, feed.cycles, aligned=False)
    playing = make_playing(
        section, scenario.camera, feed,
        even_instants(scenario.image or ImageSection(), feed.cycles), scenario.seed,
        None if scene is None else scene.source(grid),
        None if scene is None else scene.source(grid),
        None if scene is None else scene.illuminance,
    )  # fmt: skip
    return ShownMachine(machine, feed, playing, probe)
