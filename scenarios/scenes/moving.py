"""Moving scenes of studies: a texture of random waves and a small bright spot, with their mean over
an exposure in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt
from scipy.special import erf

from cosim import PS, Block, Clock, Light, Piece

MOTION: Final = 0.25
"""Longest motion within a piece of light, pixels, if a piece is longer than a cycle."""
WAVES: Final = 10
"""Number of waves. More have less contrast, because their sum must stay within the range."""
WAVELENGTHS: Final = (8.0, 64.0)
"""Shortest and longest wavelength, pixels."""
Knot = tuple[float, float, float]


class ExposedScene(Protocol):
    """A moving scene.

    Attributes:
        shape: (rows, columns).
        speed: highest speed of the content, pixels/s.
    """

    @property
    def shape(self) -> tuple[int, int]: ...

    @property
    def speed(self) -> float: ...

    def mean(self, start: float, stop: float) -> npt.NDArray[np.float64]:
        """Mean reflectance between two instants, s, (H, W) in [0, 1]."""
        ...


class ExposedSource:
    """The light of such a scene on a clock. Its integral over each piece is exact. A piece is a
    whole number of cycles, in which the content moves by at most MOTION pixels, or one cycle; so
    the charge of each latch cycle of a faster scene is exact, at any speed.

    Args:
        scene: the scene.
        illuminance: illuminance of reflectance 1 on the pixels, lux.
        clock: latch clock.
        longest: cycles of the longest piece.
    """

    def __init__(
        self, scene: ExposedScene, illuminance: float, clock: Clock, longest: int = 64
    ) -> None:
        self._scene, self._lux, self._clock = scene, illuminance, clock
        calm = MOTION * clock.hz / scene.speed if scene.speed else math.inf
        self.every = max(1, math.floor(min(calm, longest)))
        self._pieces: dict[int, Piece] = {}

    def _piece(self, cycle: int) -> Piece:
        if cycle not in self._pieces:
            start, stop = self._clock.edge(cycle), self._clock.edge(cycle + self.every)
            plane = (self._scene.mean(start / PS, stop / PS) * self._lux).astype(np.float32)
            self._pieces[cycle] = Piece(start, stop, plane, plane)
        return self._pieces[cycle]

    def step(self, data: None, block: Block) -> Light:
        first = block.start // self.every * self.every
        self._pieces = {c: p for c, p in self._pieces.items() if c >= first}
        return Light(tuple(self._piece(c) for c in range(first, block.stop, self.every)))


@dataclass(frozen=True)
class Texture:
    """A sum of waves of equal amplitude. The logarithms of their wavelengths are evenly spread, so
    each octave has the same contrast, as in images of nature (Field, JOSA A 4:2379, 1987).

    The mean over an exposure T of a wave with the wave vector k that moves at the velocity v is the
    wave at the middle of the exposure times sin(k v T/2) / (k v T/2).

    Attributes:
        shape: (rows, columns).
        velocity: velocity along columns and rows, pixels/s.
        level, swing: mean reflectance, and largest deviation from it.
        seed: seed of directions and phases.
    """

    shape: tuple[int, int]
    velocity: tuple[float, float] = (0.0, 0.0)
    level: float = 0.5
    swing: float = 0.5
    seed: int = 1

    @property
    def speed(self) -> float:
        return math.hypot(*self.velocity)

    @cached_property
    def _waves(self) -> tuple[Any, Any]:
        """Wave vectors (n, 2), radians/pixel, and phases (n,)."""
        random = np.random.Generator(np.random.Philox(key=self.seed))
        low, high = WAVELENGTHS
        lengths = low * (high / low) ** ((np.arange(WAVES) + random.random(WAVES)) / WAVES)
        # Evenly spread directions in random order: no texture is without detail in one direction.
        turn = math.pi * (random.permutation(WAVES) + random.random(WAVES)) / WAVES
        vectors = 2 * math.pi / lengths[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        return vectors, 2 * math.pi * random.random(WAVES)

    def mean(self, start: float, stop: float) -> npt.NDArray[np.float64]:
        """Mean reflectance between two instants, s, (H, W)."""
        vectors, phases = self._waves
        along = vectors @ np.array(self.velocity)  # radians/s
        fade = np.sinc(along * (stop - start) / (2 * math.pi))
        phase = phases - along * (start + stop) / 2
        height, width = self.shape
        # cos(a + b) by the parts of columns and rows: two products of matrices
        across = vectors[:, :1] * np.arange(width)
        down = vectors[:, 1:] * np.arange(height) + phase[:, None]
        waves = (fade[:, None] * np.cos(down)).T @ np.cos(across)
        waves -= (fade[:, None] * np.sin(down)).T @ np.sin(across)
        return np.asarray(self.level + self.swing / WAVES * waves)


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
