"""Puts the link and the display of a scenario behind the machine of its source."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any, Final

from cosim import Clock
from cosim.compute.opencl import choose_device
from cosim.run.machine import Machine
from cosim.run.progress import Progress
from display.probes.setup import ProbeCamera
from imagers.machine import ImagerMachine
from scenarios.assemble.camera.boards import open_panel
from scenarios.assemble.carrier.carrier import make_carrier
from scenarios.assemble.carrier.stream import THRESHOLD, CarriedStream
from scenarios.assemble.instants import check_window, even_instants
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
from scenarios.assemble.show.machine import PlayedMachine
from scenarios.assemble.show.playing import Playing
from scenarios.assemble.show.probes import ContinuousProbeCamera, EventProbeCamera
from scenarios.assemble.show.screen import make_screen
from scenarios.scenes.kinds.grid import SceneGrid
from sensor.asynchronous.machine import AsynchronousMachine
from sensor.continuous.machine import ContinuousMachine

AnySource = Scenario | ImagerScenario | RecordingScenario
PLANES: Final = 40e3
"""Planes a second for the frames of an imager, unless display.clock or link.sensor.clock says
otherwise."""


def play_events(
    scenario: Scenario, machine: AsynchronousMachine, device: str | None, progress: Progress
) -> Machine:
    """An asynchronous camera with the link and the display of its scenario."""
    if _alone(scenario):
        return machine
    probe = None if scenario.display is None else EventProbeCamera.of(machine)
    held = machine.spec.model.change > 0  # then the planes have no noise of spikes
    threshold = THRESHOLD if held else machine.spec.model.threshold
    feed = EventFeed(machine)
    return _played(scenario, machine, feed, probe, device, progress, threshold)


def play_continuous(
    scenario: Scenario, machine: ContinuousMachine, device: str | None, progress: Progress
) -> Machine:
    """A continuous camera with the link and the display of its scenario."""
    if _alone(scenario):
        return machine
    feed = ContinuousFeed(machine)
    probe = None if scenario.display is None else ContinuousProbeCamera(machine.spec, feed)
    return _played(scenario, machine, feed, probe, device, progress)


def play_frames(
    scenario: ImagerScenario, machine: ImagerMachine, device: str | None, progress: Progress
) -> Machine:
    """An imager with the link and the display of its scenario."""
    if _alone(scenario):
        return machine
    lux = scenario.scene.illuminance * machine.planned.view.gain
    feed = FrameFeed(machine, Clock.from_hz(_planes(scenario)), lux)
    return _played(scenario, machine, feed, None, device, progress)


def _planes(scenario: ImagerScenario) -> float:
    """Planes a second for the frames of an imager, Hz."""
    if scenario.display is not None and scenario.display.clock is not None:
        return scenario.display.clock
    chip = None if scenario.link is None else scenario.link.sensor
    return PLANES if chip is None else chip.clock


def play_recording(
    scenario: RecordingScenario, machine: RecordingMachine, device: str | None, progress: Progress
) -> Machine:
    """A recorded stream with the link and the display of its scenario."""
    if _alone(scenario):
        return machine
    return _played(scenario, machine, RecordedFeed(machine), None, device, progress)


def _alone(scenario: AnySource) -> bool:
    """Whether nothing takes the output of the source."""
    return scenario.display is None and scenario.link is None


def _played(
    scenario: AnySource,
    machine: Machine,
    feed: Feed,
    probe: ProbeCamera | None,
    device: str | None,
    progress: Progress,
    threshold: float = THRESHOLD,
) -> PlayedMachine:
    """Raises InputError for a link, a display or a camera that does not fit.

    threshold: of the pixels whose spikes the planes are, electrons.
    """
    scene: Any = getattr(scenario, "scene", None)
    grid = SceneGrid(feed.shape, feed.clock, feed.cycles, aligned=False)
    image = scenario.image or ImageSection()
    check_window(image)
    instants = even_instants(image, feed.cycles)
    source = None if scene is None else scene.source(grid)
    with ExitStack() as stack:
        screen = board = carrier = None
        if scenario.display is not None:
            board = stack.enter_context(open_panel(scenario.display, feed.shape))
        if scenario.display is not None and board is None:
            screen = make_screen(
                scenario.display, scenario.camera, feed, instants, scenario.seed, source,
                None if scene is None else scene.source(grid),
                None if scene is None else scene.illuminance, probe,
                None if device is None else choose_device(device),
                isinstance(scenario, RecordingScenario),
            )  # fmt: skip
            stack.callback(screen.chain.close)
        if scenario.link is not None:
            stream = CarriedStream.of(scenario, feed.shape, feed.clock, feed.cycles, threshold)
            carrier = make_carrier(stream, device, progress)
        playing = Playing(
            source, screen, board, carrier, feed.clock, feed.cycles, feed.shape, stack.pop_all()
        )  # fmt: skip
    return PlayedMachine(machine, feed, playing, image, instants)
