"""The sun and stars in one view: discs of known light, decade below decade.

Huang 2022 section 4.5 asks for 1e5 lux and 1e-4 lux at once. Every disc is a target: pixels under
one illuminance, so that a camera's error can be stated in per cent. There is the sun, a star a
decade down to FINE lux, and five a decade below, to find where a camera gives up.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from cosim import Box, Clock, InputError, Plane
from cosim.light.source import Target
from scenarios.scenes.drawing.analytic import AnalyticSource

__all__ = ["FINE", "JUST_BELOW", "Sky", "SkySource", "star_levels"]

FINE = 1e-2
"""Lux from which on stars stand five a decade."""
JUST_BELOW = 0.9
"""Of a decade: where a camera's range is said to end at one, a star beyond it tells."""
_PER_DECADE = 4
_SUN = (0.27, 0.27, 0.17)
"""Its centre down and across, and its radius, in heights, widths and the lesser of both."""
_MOST = 100
"""Stars at most."""


def star_levels(sun: float, dimmest: float) -> list[float]:
    """Lux of the stars, brightest first: by decades below the sun; from FINE on by quarters of a
    decade, and one just below each decade."""
    levels: list[float] = []
    quarters = 0
    while len(levels) < _MOST:
        coarse = not levels or levels[-1] > FINE * 1.0001
        quarters += _PER_DECADE if coarse else 1
        decade = sun * 10.0 ** (-quarters / _PER_DECADE)
        whole = not coarse and quarters % _PER_DECADE == 0
        for lux in (decade, JUST_BELOW * decade)[: 1 + whole]:
            if lux < dimmest * 0.9999:
                return levels
            levels.append(lux)
    return levels


class Sky:
    """Reflectance of the scene, the sun = 1."""

    def __init__(self, shape: tuple[int, int], sun: float, dimmest: float, background: float):
        self.shape = shape
        levels = star_levels(sun, dimmest)
        height, width = shape
        row, column = np.mgrid[:height, :width] + 0.5
        centre, radius = (_SUN[0] * height, _SUN[1] * width), _SUN[2] * min(shape)
        disc = np.hypot(row - centre[0], column - centre[1]) <= radius
        self.targets = [Target("sun", sun, disc)]
        taken = disc.copy()
        places, size = _places(shape, centre, radius, len(levels))
        for (y, x), lux in zip(places, levels, strict=False):
            mask = (np.hypot(row - y, column - x) <= size) & ~taken
            if mask.any():
                self.targets.append(Target(f"star {len(self.targets)}", lux, mask))
                taken |= mask
        if len(self.targets) <= len(levels):
            raise InputError(
                "the sensor", f"large enough for {len(levels)} stars", f"{width} x {height}",
                "enlarge sensor.asynchronous.width and height, or raise scene.dimmest",
            )  # fmt: skip
        self._plane = np.full(shape, background / sun, np.float32)
        for target in self.targets:
            self._plane[target.mask] = target.lux / sun

    def reflectance(self, t: float) -> Plane:
        return self._plane

    def speed(self) -> float:
        return 0.0

    def moving(self, start: float, stop: float) -> Box:
        return (0, 0, 0, 0)

    def points(self) -> list[tuple[int, int, str]]:
        points = []
        for target in self.targets:
            row, column = (int(np.rint(i.mean())) for i in np.nonzero(target.mask))
            points.append((row, column, target.name))
        return points


def _places(
    shape: tuple[int, int], sun: tuple[float, float], radius: float, stars: int
) -> tuple[list[tuple[float, float]], float]:
    """Centres of the stars, nearest to the sun first, and their radius: cells of a grid, shifted a
    little so that they look like a sky."""
    height, width = shape
    for side in itertools.count(2):
        cell = (height / side, width / side)
        size = 0.36 * min(cell)
        centres = []
        for n, (i, j) in enumerate(itertools.product(range(side), repeat=2)):
            # The R2 sequence: even, without a pattern that the eye finds.
            shift = [(0.5 + n * g) % 1 - 0.5 for g in (0.7548776662, 0.5698402910)]
            y = (i + 0.5 + 0.2 * shift[0]) * cell[0]
            x = (j + 0.5 + 0.2 * shift[1]) * cell[1]
            if math.hypot(y - sun[0], x - sun[1]) > radius + 1.15 * size:
                centres.append((y, x))
        if len(centres) >= stars:
            break
    return sorted(centres, key=lambda p: math.hypot(p[0] - sun[0], p[1] - sun[1])), size


class SkySource(AnalyticSource):
    """The sky as a source, with the targets that it is judged by."""

    def __init__(
        self, shape: tuple[int, int], sun: float, dimmest: float, background: float, clock: Clock
    ) -> None:
        if not dimmest < sun:
            raise InputError(
                "scene.dimmest", f"below the sun's {sun:g} lux", f"{dimmest:g} lux", "lower it"
            )
        sky = Sky(shape, sun, dimmest, background)
        super().__init__(sky, sun, clock)
        self.targets = sky.targets
        self.notes = [
            f"{len(sky.targets)} discs of steady light from {sun:g} lux to "
            f"{sky.targets[-1].lux:.3g} lux, {background:g} lux between them"
        ]
