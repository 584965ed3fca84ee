"""The survey of a scene: what a plan reads of the light on a latched camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter, minimum_filter

from cosim.clock import Clock
from cosim.light.light import Light
from cosim.light.source import Source
from cosim.light.survey import Survey, survey, through
from cosim.plan.effects import Summary
from cosim.plan.tiles import TileGrid
from sensor.latched.setting import CameraSetting

__all__ = ["SceneSurvey", "survey_scene"]


@dataclass(frozen=True, eq=False)
class SceneSurvey:
    """What a plan reads of a scene, before anything is simulated.

    Attributes:
        light: interval of every pixel's light, lux on the sensor.
        grid: tiles of the plane.
        scene: the same by tile, photoelectrons a cycle.
        certain: (tiles,) bool, whether the interval holds for certain.
    """

    light: Survey
    grid: TileGrid
    scene: Summary
    certain: npt.NDArray[np.bool_]

    @property
    def classes(self) -> dict[str, int]:
        """Tiles by what their light is: dark (none), constant, moving."""
        dark = np.asarray(self.scene.brightest) <= 0
        steady = self.grid.reduce(self.light.steady, np.logical_and) & ~dark
        return {
            "dark": int(dark.sum()),
            "constant": int(steady.sum()),
            "moving": int((~dark & ~steady).sum()),
        }


def survey_scene(
    setting: CameraSetting,
    source: Source,
    relay: Callable[[Light], Light],
    cycles: int,
    window: int,
    floor: float,
) -> SceneSurvey:
    """Surveys a scene before anything is simulated.

    Args:
        setting: the camera with every effect.
        source: the scene; it may be run through, so it must not be used afterwards.
        relay: the lens.
        cycles: of the run.
        window: cycles of the image window.
        floor: spikes a cycle below which an error counts as if the rate were this.
    """
    clock: Clock = setting.clock
    light = through(survey(source, clock, cycles), relay)
    grid = TileGrid(*light.least.shape)
    per_cycle = setting.electrons_per_lux * float(clock.period)
    low, high = light.least, light.most
    if setting.crosstalk > 0:  # what a neighbour has, a pixel may get
        low, high = minimum_filter(low, 3), maximum_filter(high, 3)
    darkest = grid.reduce(low, np.minimum).astype(float) * per_cycle
    brightest = grid.reduce(high, np.maximum).astype(float) * per_cycle
    if setting.pattern is not None:
        own = setting.pattern.dark * float(clock.period)
        brightest = brightest + own * (1 + 4 * setting.pattern.dsnu)
    darkest, brightest = (setting.transferred(electrons) for electrons in (darkest, brightest))
    moving = ~grid.reduce(light.steady, np.logical_and)
    scene = Summary(
        darkest, brightest, setting.threshold, window, cycles, floor,
        setting.spread, np.where(moving, light.planes, 0.0), setting.slack,
        setting.dead_time * clock.hz,
    )  # fmt: skip
    certain = light.certain
    if setting.crosstalk > 0:
        certain = minimum_filter(certain, 3)
    return SceneSurvey(light, grid, scene, grid.reduce(certain, np.logical_and))
