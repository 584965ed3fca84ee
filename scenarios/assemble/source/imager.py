"""Assembles the machine of a scenario with an [imager]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, InputError, Light, seconds_to_ps
from cosim.config.toml import to_toml
from cosim.light.lens import Lens
from cosim.light.survey import survey
from cosim.run.folder import check_trace_file
from cosim.run.machine import Options, Outcome, Recording
from cosim.spikes.clocked import (
    Change,
    HeldPlanes,
    latching_cycles,
)
from imagers.catalogue import IMAGERS
from imagers.common.model import FrameFigures, ImagerModel, View
from imagers.common.scenery import LightScenery, Scenery, Still
from imagers.machine import ImagerMachine, ImagerStudy
from imagers.run.plan import PlannedRun, RunSpec, plan_run
from imagers.run.tape import FRAMES, read_frame
from scenarios.assemble.schema.scenario import ImagerScenario
from scenarios.assemble.source.feeds import Feed, Planes
from scenarios.scenes.charts.target import target_course, target_plane
from scenarios.scenes.kinds.grid import SceneGrid
from scenarios.scenes.kinds.target import TargetScene

LIGHT_CLOCK = Clock(1000)
"""The default clock on whose edges a moving scene is drawn. An edge in the scene that moves faster
than one pixel a millisecond is drawn more coarsely; a note of the run states this."""
PLANES: Final = 40e3
"""Planes a second for the frames of an imager, unless display.clock or link.sensor.clock says
otherwise."""
Values = npt.NDArray[np.float64]


def assemble_imager(name: str, scenario: ImagerScenario, options: Options) -> ImagerMachine:
    """The machine of a scenario. Raises InputError."""
    if scenario.link is None:  # its chip may run on a device
        _refuse_device(options.device)
    if options.trace is not None:
        check_trace_file(options.trace)
    kind = IMAGERS[scenario.imager.kind]
    return ImagerMachine(kind, plan_imager(name, scenario), options.trace)


def assemble_imager_study(name: str, scenario: ImagerScenario, device: str | None) -> ImagerStudy:
    """The study of an imager for `viform plan` and `viform accuracy`. Raises InputError."""
    _refuse_device(device)
    return ImagerStudy(plan_imager(name, scenario))


def plan_imager(name: str, scenario: ImagerScenario) -> PlannedRun:
    """The run of a scenario, planned for its tolerance. Raises InputError."""
    kind = IMAGERS[scenario.imager.kind]
    model = kind.model(scenario.imager, scenario.duration)
    spec = RunSpec(
        name,
        scenario.title,
        kind.name,
        scenario.duration,
        scenario.tolerance,
        scenario.seed,
        to_toml(scenario),
    )
    return plan_run(spec, model, make_view(scenario, model.shape))


def _refuse_device(device: str | None) -> None:
    if device not in (None, "numba"):
        raise InputError(
            "--device", "numba, or absent, for an imager other than a spike camera", repr(device),
            "leave it out: these imagers run on this processor",
        )  # fmt: skip


def _gain(scenario: ImagerScenario) -> tuple[float, str]:
    lens = scenario.lens
    if lens is None:
        return 1.0, "no lens: the illuminance of the scene falls on the pixels unchanged"
    gain = Lens(lens.f_number, lens.transmission, lens.magnification).gain
    return gain, (
        f"lens f/{lens.f_number:g}, transmission {lens.transmission:g}: {gain:.3g} lux on the "
        "pixels for 1 lux of exitance, E T / (4 N^2 (1 + m)^2)"
    )


def _factors(scene: TargetScene, stop: int) -> tuple[float, float]:
    """Least and largest brightness factor within the run, which ends at `stop`, ps."""
    course = target_course(scene)
    factors = [course.at(0), course.at(stop)]
    factors += [factor for time, factor in course.knots if 0 <= time <= stop]
    return min(factors), max(factors)


def make_view(scenario: ImagerScenario, shape: tuple[int, int], clock: Clock = LIGHT_CLOCK) -> View:
    """The scene on the pixels of an imager.

    Args:
        scenario: the scenario of the imager.
        shape: (rows, columns) of the imager.
        clock: clock on whose edges a moving scene is drawn.

    Raises:
        InputError: the scene cannot be drawn.
    """
    gain, lens_note = _gain(scenario)
    scene, stop = scenario.scene, seconds_to_ps(scenario.duration)
    if isinstance(scene, TargetScene):
        chart = target_plane(scene, shape)
        lux = chart * (scene.illuminance * gain)
        low, high = _factors(scene, stop)
        lit = Still(lux, target_course(scene))
        name = scene.chart if scene.path is None else ""
        return View(lit, gain, lux * low, lux * high, True, chart, [lens_note], [], name)
    cycles = clock.cycle_at(stop) + 1
    grid = SceneGrid(shape, clock, cycles)
    source = scene.source(grid)

    def light(begin: int, end: int) -> Light:
        first = clock.cycle_at(begin)
        return source.step(None, Block(first, clock.cycle_at(max(end - 1, begin)) + 1 - first))

    limits = survey(scene.source(grid), clock, cycles)
    least, most = (np.asarray(plane, np.float64) * gain for plane in (limits.least, limits.most))
    scenery = _Lensed(LightScenery(shape, light), gain)
    steady = bool(limits.steady.all())
    still = np.asarray(source.truth(0), np.float64) if steady else None
    drawing = (
        f"light is drawn on the edges of a clock of {clock.hz:g} Hz, with linear interpolation"
    )
    notes = [lens_note, *source.notes, drawing]
    return View(
        scenery, gain, least, most, bool(limits.certain.all()), still, notes, source.degraded,
        metrics=getattr(source, "metrics", {}),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Lensed:
    """Scenery behind an ideal lens: the illuminance is scaled by one factor.

    Attributes:
        scenery: illuminance in front of the lens, lux.
        gain: illuminance on the pixels over that of the scene.
    """

    scenery: Scenery
    gain: float

    @property
    def shape(self) -> tuple[int, int]:
        return self.scenery.shape

    def lux_seconds(
        self, first: int, begin: npt.NDArray[np.int64], end: npt.NDArray[np.int64]
    ) -> Values:
        """Implements `Scenery.lux_seconds`."""
        return np.asarray(self.scenery.lux_seconds(first, begin, end) * self.gain)


def _planes(scenario: ImagerScenario) -> float:
    """Planes a second for the frames of an imager, Hz."""
    if scenario.display is not None and scenario.display.clock is not None:
        return scenario.display.clock
    chip = None if scenario.link is None else scenario.link.sensor
    return PLANES if chip is None else chip.clock


class _Frames:
    """The frames of an imager as `Changes`; those that no cycle shows are not read."""

    def __init__(
        self, frames: Sequence[FrameFigures], path: Path, model: ImagerModel, bits: int,
        lux: float, cycles: Any,
    ) -> None:  # fmt: skip
        self._frames, self._path, self._model = frames, path, model
        self._bits, self._lux, self._cycles = bits, lux, cycles
        self.white = model.levels(np.zeros((1, 1), np.uint16), bits, lux)[1]

    def between(self, start: int, stop: int) -> list[Change]:
        """See `Changes`."""
        first, last = np.searchsorted(self._cycles, [start, stop])
        return [self._change(n) for n in range(int(first), int(last))]

    def _change(self, n: int) -> Change:
        values = read_frame(self._path, n)
        levels, _ = self._model.levels(values, self._bits, self._lux)
        (rows, columns), plane = values.shape, self._model.shape
        if values.shape == plane:
            return Change(int(self._cycles[n]), None, levels.ravel())
        row = np.arange(rows) + self._model.first_row(self._frames[n].state)
        pixel = (row[:, None] * plane[1] + np.arange(columns)).ravel()
        return Change(int(self._cycles[n]), pixel, levels.ravel())


class FrameFeed(Feed):
    """The frames of an imager."""

    def __init__(self, scenario: ImagerScenario, machine: ImagerMachine) -> None:
        planned = machine.planned
        lux = scenario.scene.illuminance * planned.view.gain  # of white, on the plane
        clock = Clock.from_hz(_planes(scenario))
        self._planned, self._lux = planned, lux
        levels = planned.model.levels(np.zeros((1, 1), np.uint16), planned.pixels.bits, lux)[1]
        super().__init__(
            planned.model.shape, clock, max(clock.cycles_in(planned.spec.stop), 1), 1.0,
            f"a value of {levels}, which fires in every cycle; a frame is shown from the end of "
            "its readout to that of the next", scenario.scene,
        )  # fmt: skip

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """See `Feed`."""
        frames, planned = recording.chain.frames, self._planned
        ready = np.array([frame.ready for frame in frames], np.int64)
        cycle = latching_cycles(ready, self.clock, self.cycles)
        changes = _Frames(
            frames, recording.folder / FRAMES, planned.model, planned.pixels.bits, self._lux, cycle
        )
        return Planes(HeldPlanes(changes, self.shape, self.clock, changes.white))
