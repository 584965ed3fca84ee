"""A plane of random waves that moves at a constant velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

WAVES: Final = 10
"""Number of waves. More have less contrast, because their sum must stay within the range."""
WAVELENGTHS: Final = (8.0, 64.0)
"""Shortest and longest wavelength, pixels."""


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
