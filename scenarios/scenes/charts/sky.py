"""The sun and stars in one image: discs of known illuminance over many decades.

Huang 2022, section 4.5, requires 1e5 lux and 1e-4 lux at once. Every disc is a target, a set of
pixels with one illuminance, for which the error of a camera is reported in per cent. The scene has
the sun, one star for each decade down to FINE lux, and five for each decade below, which show the
limit of a camera.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from cosim import Box, Clock, InputError, Plane
from cosim.light.source import Target
from scenarios.scenes.drawing.analytic import AnalyticSource

FINE = 1e-2
"""Illuminance below which there are five stars in a decade, lux."""
JUST_BELOW = 0.9
"""Illuminance of the additional star below a decade, over the decade: it tests a range that ends at
the decade."""
_PER_DECADE = 4
_SUN = (0.27, 0.27, 0.17)
"""Row and column of the centre of the sun over height and width, and its radius over the lesser of
the two."""
_MOST = 100
"""Maximum number of stars."""


def star_levels(sun: float, dimmest: float) -> list[float]:
    """Illuminances of the stars, lux, in decreasing order: decades below the sun; below FINE
    quarters of a decade, and one additional star just below each decade."""
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
    """The scene; its reflectance is relative to the sun.

    Attributes:
        shape: (height, width), pixels.
        targets: discs with their pixels and illuminance.
    """

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
                "the array of pixels", f"large enough for {len(levels)} stars",
                f"{width} x {height}",
                "enlarge its width and height, or raise scene.dimmest",
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
    """Centres of the stars, the nearest to the sun first, and their radius, pixels: cells of a
    grid, with small shifts."""
    height, width = shape
    for side in itertools.count(2):
        cell = (height / side, width / side)
        size = 0.36 * min(cell)
        centres = []
        for n, (i, j) in enumerate(itertools.product(range(side), repeat=2)):
            # The R2 sequence: uniform, without a visible pattern.
            shift = [(0.5 + n * g) % 1 - 0.5 for g in (0.7548776662, 0.5698402910)]
            y = (i + 0.5 + 0.2 * shift[0]) * cell[0]
            x = (j + 0.5 + 0.2 * shift[1]) * cell[1]
            if math.hypot(y - sun[0], x - sun[1]) > radius + 1.15 * size:
                centres.append((y, x))
        if len(centres) >= stars:
            break
    return sorted(centres, key=lambda p: math.hypot(p[0] - sun[0], p[1] - sun[1])), size


class SkySource(AnalyticSource):
    """The sky as the `Source` of a run, with the targets for its evaluation."""

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
