"""The illuminance that the scene of a scenario causes on the pixels of an imager."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, Light, seconds_to_ps
from cosim.light.lens import Lens
from cosim.light.survey import survey
from imagers.common.model import View
from imagers.common.scenery import LightScenery, Scenery, Still
from scenarios.assemble.schema.scenario import ImagerScenario
from scenarios.scenes.charts.target import target_course, target_plane
from scenarios.scenes.kinds.grid import SceneGrid
from scenarios.scenes.kinds.target import TargetScene

LIGHT_CLOCK = Clock(1000)
"""The default clock on whose edges a moving scene is drawn. An edge in the scene that moves faster
than one pixel a millisecond is drawn more coarsely; a note of the run states this."""
Values = npt.NDArray[np.float64]


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
