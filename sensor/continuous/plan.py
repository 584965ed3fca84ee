"""The plan of a continuous camera, its check on a few tiles, and the error of its model in law.

**Error.** What a pixel has reported is held until its next report; its mean over a window of cycles
around each image is the quantity. The error of a tile is the root mean square over its pixels and
windows of the difference from full physics, relative to the mean of the tile or to the floor, which
is the photocurrent of a spike camera's floor: `image.floor` spikes a cycle of its threshold.

**Left out.** Only shot noise costs time. Without it pixels go from crossing to crossing. In steady
light that changes every reported value by the noise that it would have had, sqrt(i / 2 tau), or
sqrt(i / T) where pixels measure. In light that changes a report also falls earlier or later, and
the values held differ by up to a threshold; then it is kept.

**In law.** Shot noise is drawn in the limit of many electrons, with the mean, the variance and the
correlation of single ones, without their skewness g = 2 sqrt(2) / (3 sqrt(i tau)) (Rice, Bell Syst.
Tech. J. 23:282, 1944), or 1 / sqrt(i T). To first order in g the distance of the two distributions
of a value is s g sqrt(2) / 6 of its deviation s (Cornish and Fisher, Rev. Inst. Int. Stat. 5:307,
1938; the root mean square of the difference at one probability): sqrt(2) / (9 tau), electrons a
second at any light. A measurement also counts whole electrons, which lie 1 / sqrt(12) from a
continuous value: (1/18 + 1/12)^1/2 / T.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from cosim.light.light import Light
from cosim.light.steps import is_steady
from cosim.plan.effects import Bound, Effect, Summary
from cosim.plan.error import (
    EVERYTHING,
    Bounds,
    Finding,
    Law,
    LawFigure,
    Measured,
    accepted_error,
    reinstated,
)
from cosim.plan.planner import EffectRow, Plan, choose_tiles, make_plan
from cosim.plan.tiles import TileGrid
from cosim.spikes.intensities import Intensities
from sensor.continuous.crossing import Reports
from sensor.continuous.reference import Reference, State
from sensor.continuous.setting import ContinuousSetting

SHOT: Final = "shot noise"
KIND: Final = "reported value held over the image windows, worst tile"
MOST: Final = 4096
"""Cycles that the reference follows at most, since it looks at each: a tenth of a second."""
NOISE_NS: Final = 25.0
"""Cost of shot noise, ns per pixel and cycle: measured on two cores."""
_HERMITE: Final = 1.5100
"""Mean of |z^3 - 3 z| of a normal z: 2 (4 phi(sqrt 3) + phi(0))."""

Reals = npt.NDArray[np.float64]
Windows = Sequence[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class IntensityPlan:
    """Plan of a continuous camera.

    Attributes:
        setting: Setting with every effect.
        names: Effects that act, by name.
        grid: Tiles of the chip.
        mean: (tiles,) mean photocurrent, electrons/s, of the light that a run begins with.
        floor: Photocurrent to which errors of darker tiles are relative, electrons/s.
        plan: Effects that each tile keeps; what is not in it is kept.
    """

    setting: ContinuousSetting
    names: tuple[str, ...]
    grid: TileGrid
    mean: Reals
    floor: float
    plan: Plan

    @property
    def scale(self) -> Reals:
        """(tiles,) photocurrent to which errors are relative, electrons/s."""
        return np.maximum(self.mean, self.floor)

    @property
    def planned(self) -> ContinuousSetting:
        """Setting of the pixels that run."""
        return replace(self.setting, noise=self.setting.noise and SHOT not in self.plan.left_out)

    @property
    def kept(self) -> list[str]:
        """Effects that act, by name."""
        return [name for name in self.names if name not in self.plan.left_out]

    @property
    def rows(self) -> list[EffectRow]:
        """A row for each effect; what costs nothing is kept, and has no bound."""
        found = {row.effect: row for row in self.plan.rows}
        return [found.get(name, EffectRow(name, math.inf, "estimate", 1.0)) for name in self.names]

    @property
    def absent(self) -> list[EffectRow]:
        """Rows of the effects that are left out."""
        return [row for row in self.rows if row.effect in self.plan.left_out]

    def keeping(self, effects: Sequence[str]) -> IntensityPlan:
        """The plan with these effects kept; EVERYTHING stands for all."""
        names = set(self.plan.kept) if EVERYTHING in effects else set(effects)
        return replace(self, plan=self.plan.keeping(names))

    @property
    def apart(self) -> tuple[Reals, Reals]:
        """(tiles,) distance of the reported values from those of single electrons in law, relative,
        and its upper limit: the next term is smaller by about the skewness, and the distance is at
        most that of independent values. 0 where shot noise does not act."""
        none = np.zeros_like(self.mean)
        if not self.planned.noise:
            return none, none
        size, skew, deviation = law_of(self.setting, self.mean)
        most = np.minimum(size * (1 + skew), math.sqrt(2) * deviation)
        return np.minimum(size, most) / self.scale, most / self.scale

    @property
    def law(self) -> Law | None:
        """Error in law: of the mean, the variance and correlations none, of the distribution of
        values the total variation by the skewness; None without shot noise."""
        if not self.planned.noise:
            return None
        change = np.minimum(law_of(self.setting, self.mean)[1] * _HERMITE / 12, 1.0)
        none = LawFigure(0.0, (0.0, 0.0))
        tv = LawFigure(float(change.max()), (float(change.min()), float(change.max())))
        return Law(none, none, tv, none)

    def bounds(self, measured: Measured | None = None) -> Bounds:
        """What is promised of the error, and what a check has measured."""
        law = self.law
        return Bounds(
            bound=float((self.plan.total + self.apart[1]).max()),
            kind="estimate" if self.plan.left_out or law is not None else "proof",
            left_out={row.effect: row.bound for row in self.absent}, kept=tuple(self.kept),
            tolerance=self.plan.tolerance, measured=measured,
            of="run" if law is None else "law", law=law,
        )  # fmt: skip

    def tiles(self) -> list[int]:
        """Numbers of the tiles to check: the brightest, the darkest and some at random."""
        every = np.arange(self.mean.size)
        return sorted(choose_tiles(self.plan, [self.mean, -self.mean], every, self.setting.seed))


def law_of(setting: ContinuousSetting, mean: Reals) -> tuple[float, Reals, Reals]:
    """Distance in law of a reported value from that of single electrons to first order
    (electrons/s), skewness of the latter, and its standard deviation (electrons/s). mean: (n,)
    photocurrent, electrons/s."""
    with np.errstate(divide="ignore"):
        if setting.measure > 0:
            t = setting.ticks(setting.measure) * float(setting.clock.period)
            return math.sqrt(5) / (6 * t), 1 / np.sqrt(mean * t), np.sqrt(mean / t)
        tau = setting.time_constant
        skew = 2 * math.sqrt(2) / (3 * np.sqrt(mean * tau))
        return math.sqrt(2) / (9 * tau), skew, np.sqrt(mean / (2 * tau))


def plan_intensities(
    setting: ContinuousSetting, names: tuple[str, ...], floor: float, tolerance: float,
    light: Light, stop: int,
) -> IntensityPlan:  # fmt: skip
    """The plan of a run, from the light that it begins with.

    Args:
        setting: setting with every effect.
        names: effects that act, by name.
        floor: photocurrent to which errors of darker tiles are relative, electrons/s.
        tolerance: allowed relative error; 0 keeps everything.
        light: lux on the pixels.
        stop: end of the run, ps.
    """
    chip = setting.chip
    grid = TileGrid(chip.height, chip.width)
    pixels = grid.reduce(np.ones((chip.height, chip.width)), np.add)
    lux = grid.reduce(light.pieces[0].first.astype(np.float64), np.add) / pixels
    dark = 0.0 if setting.pattern is None else setting.pattern.dark
    mean = lux * setting.electrons_per_lux + dark
    scale = np.maximum(mean, floor)
    deviation = law_of(setting, mean)[2]
    if not is_steady(light, stop):
        deviation = np.full_like(mean, np.inf)
    effect = Effect(
        SHOT, "Campbell's theorem; Rice, Bell Syst. Tech. J. 23:282, 1944", Stream.CONTINUOUS,
        lambda scene: Bound(deviation / scale, "estimate"), lambda scene: NOISE_NS,
    )  # fmt: skip
    effects = [effect] if setting.noise else []
    scene = Summary(mean, mean, 1.0, 1, max(setting.clock.cycle_at(stop - 1), 1), floor)
    plan = make_plan(effects, scene, tolerance) if effects else _nothing(tolerance, mean.size)
    return IntensityPlan(setting, names, grid, mean, floor, plan)


def _nothing(tolerance: float, tiles: int) -> Plan:
    """A plan without an effect that could be left out."""
    return Plan(tolerance, (), {}, {}, np.zeros(tiles), 0.0, 0.0)


def any_light(
    setting: ContinuousSetting, names: tuple[str, ...], floor: float, tolerance: float
) -> IntensityPlan:
    """The plan that keeps everything, with a tile for each light from far below the floor to above
    it, where the error in law is largest."""
    mean = np.geomspace(1e-6, 1e2, 200) * floor
    plan = _nothing(tolerance, mean.size)
    return IntensityPlan(setting, names, TileGrid(1, mean.size), mean, floor, plan)


def held_means(reports: Reports, pixels: int, windows: Windows) -> Reals:
    """Mean of the value that a pixel has reported last, over each window of cycles, first to stop,
    (windows, pixels); 0 before the first report."""
    order = np.lexsort((reports.tick, reports.pixel))
    pixel, tick, value = reports.pixel[order], reports.tick[order], reports.value[order]
    until = np.append(tick[1:], 0)
    until[np.append(pixel[1:] != pixel[:-1], True)] = np.iinfo(np.int64).max
    means = np.zeros((len(windows), pixels))
    for n, (first, stop) in enumerate(windows):
        lasts = np.maximum(np.minimum(until, stop) - np.maximum(tick, first), 0)
        means[n] = np.bincount(pixel, value * lasts, pixels) / (stop - first)
    return means


def windows_at(instants: Sequence[int], window: int, cycles: int) -> list[tuple[int, int]]:
    """Cycles around each instant, first to stop, as far as the run goes."""
    half = window // 2
    return [(max(n - half, 0), min(n + half + 1, cycles)) for n in instants]


class PatchCheck:
    """Full physics on a few tiles, beside a run; a stage that passes light on.

    Args:
        plan: the plan that is checked.
        tiles: numbers of the tiles.
    """

    def __init__(self, plan: IntensityPlan, tiles: Sequence[int]) -> None:
        self.plan, self.tiles = plan, list(tiles)
        boxes = [plan.grid.box(tile) for tile in tiles]
        width = plan.grid.width
        numbers = [(np.arange(y0, y1)[:, None] * width + np.arange(x0, x1)).ravel()
                   for y0, y1, x0, x1 in boxes]  # fmt: skip
        self._sizes = [len(part) for part in numbers]
        self._numbers = np.concatenate(numbers)
        self._until = 0
        self._reference = Reference(plan.setting, self._numbers.astype(np.uint32))

    def step(self, light: Light, start: int, stop: int) -> Light:
        """The light, unchanged."""
        clock = self.plan.setting.clock
        last = min(stop, clock.edge(MOST))
        if start < last:
            self._reference.step(light, start, last)
            self._until = clock.cycle_at(last - 1) + 1
        return light

    def state(self) -> State:
        return self._reference.state() | {"until": np.array(self._until)}

    def restore(self, state: State) -> None:
        if state:
            self._until = int(state["until"])
            self._reference.restore(state)

    def measured(self, reports: Intensities, windows: Windows) -> list[Measured]:
        """The error of each tile, of the run and, with shot noise, in law, in the windows that the
        reference has followed, or in the last cycles if there is none. reports: of the whole
        chip."""
        most = max(last - first for first, last in windows)
        end = self._until
        windows = [one for one in windows if one[1] <= end] or [(max(end - most, 0), end)]
        place = np.full(self.plan.grid.height * self.plan.grid.width, -1, np.int64)
        place[self._numbers] = np.arange(self._numbers.size)
        mine = place[reports.pixel]
        there = mine >= 0
        own = Reports(mine[there], reports.time[there], reports.value[there])
        one = held_means(own, self._numbers.size, windows)
        two = held_means(self._reference.reports(), self._numbers.size, windows)
        apart, limit = self.plan.apart
        found, cuts = [], np.cumsum(self._sizes)[:-1]
        parts = (np.split(values, cuts, axis=1) for values in ((one - two) ** 2, two))
        for tile, squares, truth in zip(self.tiles, *parts, strict=True):
            scale = max(float(truth.mean()), self.plan.floor)
            error = Measured.rms(squares.mean(0), scale, tile)
            found.append(error.in_law(float(apart[tile]), most=float(limit[tile])))
        return found

    def worst(self, found: Sequence[Measured]) -> Measured:
        """The error of the worst tile; its upper limit holds for all tiles, for those that were not
        measured by the bounds."""
        error = Measured.worst(found)
        assert error is not None  # of no tile
        others = np.delete(self.plan.plan.total + self.plan.apart[1], self.tiles)
        return replace(error, high=max(error.high, float(others.max(initial=0.0))))

    def shortfall(self, found: Sequence[Measured]) -> list[Finding]:
        """The effects to reinstate where an error is above its bound or the tolerance."""
        plan = self.plan.plan
        if not plan.left_out:
            return []
        over = [error for error in found if error.high > plan.promise[SHOT][error.tile]]
        if over:
            first, tile = over[0], over[0].tile
            assert tile is not None
            return [reinstated(SHOT, float(plan.promise[SHOT][tile]), first.high, tile)]
        worst = max(error.high for error in found)
        return [reinstated(EVERYTHING, plan.tolerance, worst)] if worst > plan.tolerance else []

    def left_out(self, found: Sequence[Measured]) -> list[dict[str, Any]]:
        """Rows of `result.json` of what is left out."""
        worst = max((error.value for error in found), default=None)
        return [
            {"effect": row.effect, "bound": row.bound, "kind": row.kind, "measured": worst}
            for row in self.plan.absent
        ]

    def over(self, found: Sequence[Measured]) -> int:
        """Number of tiles whose error is above the tolerance."""
        return sum(error.value > accepted_error(self.plan.plan.tolerance) for error in found)
