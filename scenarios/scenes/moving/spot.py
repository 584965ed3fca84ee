"""A small bright object that appears, moves, turns abruptly and disappears."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.special import erf

from scenarios.scenes.moving.texture import Texture

Knot = tuple[float, float, float]


@dataclass(frozen=True)
class Spot:
    """An object with a Gaussian profile before a static background: the reflectance is
    B + (reflectance - B) exp(-r^2 / (2 sigma^2)), with r the distance from the object's centre.

    The centre moves at a constant velocity from knot to knot. With u and w the position of a pixel
    along the way and across it, relative to its begin, and s the speed, all over sqrt(2) sigma, and
    T the time, the integral of the profile over the time is
    exp(-w^2) sqrt(pi) / (2 s) [erf(u) - erf(u - s T)].

    Attributes:
        background: what is behind it, without motion.
        knots: (instant in s, column, row) of the centre, in order; the object appears at the first
            and disappears at the last.
        sigma: standard deviation of the profile, pixels.
        reflectance: reflectance of the object's centre.
    """

    background: Texture
    knots: tuple[Knot, ...]
    sigma: float = 2.0
    reflectance: float = 1.0

    def __post_init__(self) -> None:
        if len(self.knots) < 2 or any(a[0] >= b[0] for a, b in pairwise(self.knots)):
            raise ValueError(f"knots must be two or more in order of time, not {self.knots}")

    @property
    def shape(self) -> tuple[int, int]:
        return self.background.shape

    @property
    def speed(self) -> float:
        return max(
            math.hypot(b[1] - a[1], b[2] - a[2]) / (b[0] - a[0]) for a, b in pairwise(self.knots)
        )

    def position(self, t: float) -> tuple[float, float] | None:
        """Column and row of the centre; None while the object is not there."""
        for a, b in pairwise(self.knots):
            if a[0] <= t <= b[0]:
                share = (t - a[0]) / (b[0] - a[0])
                return a[1] + (b[1] - a[1]) * share, a[2] + (b[2] - a[2]) * share
        return None

    def velocity(self, leg: int) -> tuple[float, float]:
        """Velocity of columns and rows between the knots `leg` and `leg` + 1, pixels/s."""
        a, b = self.knots[leg], self.knots[leg + 1]
        return (b[1] - a[1]) / (b[0] - a[0]), (b[2] - a[2]) / (b[0] - a[0])

    @cached_property
    def _still(self) -> npt.NDArray[np.float64]:
        return self.background.mean(0.0, 0.0)

    def mean(self, start: float, stop: float) -> npt.NDArray[np.float64]:
        """Mean reflectance between two instants, s, (H, W)."""
        y, x = np.ogrid[: self.shape[0], : self.shape[1]]
        cover = np.zeros(self.shape)
        root = math.sqrt(2) * self.sigma
        for leg, (a, b) in enumerate(pairwise(self.knots)):
            first, last = max(start, a[0]), min(stop, b[0])
            if first >= last:
                continue
            vx, vy = self.velocity(leg)
            dx = x - (a[1] + vx * (first - a[0]))
            dy = y - (a[2] + vy * (first - a[0]))
            speed, seconds = math.hypot(vx, vy) / root, last - first
            if speed == 0:
                cover += seconds * np.exp(-(dx**2 + dy**2) / root**2)
                continue
            scale = speed * root**2
            along, across = (dx * vx + dy * vy) / scale, (dx * vy - dy * vx) / scale
            passed = erf(along) - erf(along - speed * seconds)
            cover += np.exp(-(across**2)) * math.sqrt(math.pi) / (2 * speed) * passed
        cover /= stop - start
        return np.asarray(self._still + (self.reflectance - self._still) * cover)
