"""Survey of the light that a scene puts on a latched camera, for the planner."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Light, Plane
from cosim.light.source import Source
from cosim.light.survey import Survey, survey, through
from cosim.plan.effects import Summary
from cosim.plan.tiles import TILE, TileGrid
from sensor.latched.effects.drift import KNOT, STEP
from sensor.latched.setting import CameraSetting

_SIGMAS: Final = 4.0
"""Deviations of the drift within which light is taken to lie."""


@dataclass(frozen=True, eq=False)
class SceneSurvey:
    """Range of the light of a scene, before anything is simulated.

    Attributes:
        light: range of every pixel's light, lux on the sensor.
        grid: tiles of the plane.
        scene: range of the light of each tile, photoelectrons a cycle.
        certain: (tiles,) bool, whether the range is exact and not sampled.
    """

    light: Survey
    grid: TileGrid
    scene: Summary
    certain: npt.NDArray[np.bool_]

    @property
    def classes(self) -> dict[str, int]:
        """Numbers of tiles without light ("dark"), with constant light and with moving light."""
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
        source: the scene. The survey may consume it, so it must not be used afterwards.
        relay: the lens, which maps the light of the scene onto the sensor.
        cycles: length of the run.
        window: cycles of the image window.
        floor: spikes a cycle. Errors of lower rates are relative to this rate.
    """
    light = through(survey(source, setting.clock, cycles), relay)
    return summarise(setting, light, cycles, window, floor)


def summarise(
    setting: CameraSetting, light: Survey, cycles: int, window: int, floor: float
) -> SceneSurvey:
    """The survey of a camera from the range of the light on its pixels, lux; the other arguments
    are those of `survey_scene`."""
    clock: Clock = setting.clock
    grid = TileGrid(*light.least.shape)
    per_cycle = setting.electrons_per_lux * float(clock.period)
    darkest = -_most(grid, setting, -light.least) * per_cycle
    brightest = _most(grid, setting, light.most) * per_cycle
    brightest = brightest + setting.dark_charge
    excess, timing = setting.uneven_tiles
    if excess is not None:
        brightest = brightest + excess
    slope, moved = _changes(setting, light, grid, per_cycle, brightest, cycles)
    darkest, brightest = (setting.transfer(electrons) for electrons in (darkest, brightest))
    brightest = brightest * (1 + _SIGMAS * setting.drift)
    darkest = darkest * max(1 - _SIGMAS * setting.drift, 0.0)
    # A cycle is longer by the difference of two moves; twice its RMS is rarely exceeded.
    brightest = brightest * (1 + 2 * 2**0.5 * timing)
    moving = ~grid.reduce(light.steady, np.logical_and)
    scene = Summary(
        darkest, brightest, setting.threshold, window, cycles, floor,
        setting.spread, np.where(moving, light.planes, 0.0), setting.slack,
        setting.dead_time * clock.hz, setting.uneven, timing, slope, moved,
    )  # fmt: skip
    certain = np.ones(len(grid), bool)
    if not light.certain.all():
        certain = _most(grid, setting, (~light.certain).astype(np.float32)) == 0
    return SceneSurvey(light, grid, scene, certain)


def _changes(
    setting: CameraSetting, light: Survey, grid: TileGrid, per_cycle: float,
    brightest: npt.NDArray[np.float64], cycles: int,
) -> tuple[Any, Any]:  # fmt: skip
    """Limit of the change of the light of a tile within a cycle, and sum of all changes, electrons
    a cycle, (tiles,) each; infinite if they are not known. brightest: (tiles,) electrons a cycle,
    before transfers."""
    if light.slope is None or light.moved is None or setting.model.transfers:
        return np.inf, np.inf
    slope, moved = (_most(grid, setting, plane) * per_cycle for plane in (light.slope, light.moved))
    # A gain moves by the part STEP / KNOT of the difference of two normal values.
    step = brightest * (2 * _SIGMAS * setting.drift * STEP / KNOT)
    return slope + step, moved + step * (cycles / STEP + 1)


def _most(grid: TileGrid, setting: CameraSetting, plane: Plane) -> npt.NDArray[np.float64]:
    """The most that a pixel of each tile may have, (tiles,): with cross-talk also what the pixels
    around the tile have, whose light it may receive."""
    from cosim.light.survey_compiled import most_of_tiles  # numba, which other starts need not load

    out = np.empty(grid.shape, np.float32)
    reach = 1 if setting.crosstalk > 0 else 0
    most_of_tiles(np.ascontiguousarray(plane, np.float32), TILE, reach, out)
    return out.ravel().astype(np.float64)
