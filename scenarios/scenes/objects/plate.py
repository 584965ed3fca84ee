"""A flat, textured plate in space before a pinhole camera, and its projection in closed form.

The camera is at the origin and looks along +Z, with X to the right and Y down, metres. A point
(u, v) of a plate's own plane is at P = R (u, v, 0) + T, and is seen at x = cx + F Px / Pz,
y = cy + F Py / Pz, pixels; pixel (i, j) spans i to i + 1 and j to j + 1. So a plate is seen through
the homography H = K [r1 r2 T], whose third row gives the depth Pz (R. Hartley and A. Zisserman,
Multiple View Geometry, 2nd ed., section 8.1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

Matrix = npt.NDArray[np.float64]

FOCAL: Final = 1.2
"""Focal length over the shorter side of the picture (assumed): 45 degrees across it."""
CATEGORIES: Final = ("ellipse", "rectangle", "flower")
"""Kinds of outline, by their COCO category less 1."""


def intrinsics(shape: tuple[int, int]) -> Matrix:
    """The matrix K of the camera for a picture of (height, width) pixels, (3, 3)."""
    height, width = shape
    focal = FOCAL * min(shape)
    return np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])


@dataclass(frozen=True)
class Wave:
    """One sine of a texture: share · sin(2π (p u + q v) + phase), with p and q in cycles/m."""

    p: float
    q: float
    phase: float
    share: float


@dataclass(frozen=True)
class Plate:
    """A plate. Its outline is ‖(u/a, v/b)‖ₙ = 1 + petal cos(m φ), φ the angle of (u/a, v/b).

    Attributes:
        category: number in CATEGORIES; None for the background, which has no outline.
        a, b: semi-axes, m.
        power: n of the norm; 2 for an ellipse, more for a rectangle with round corners.
        petals, petal: m and the size of the petals, a share of the semi-axes.
        x, y, z: centre in the middle of its motion, m.
        swing: amplitude of the motion along (cos heading, sin heading), m.
        heading: direction of the motion, rad.
        rate, phase: rate and phase of the motion, rad/s and rad.
        pump, pump_phase: amplitude of the depth, m, and phase, rad.
        turn, spin: angle in its own plane at t = 0, rad, and its rate, rad/s.
        tilt, tilt_axis: slant of the plane, rad, about the axis (cos, sin, 0) of this angle.
        tone: mean reflectance.
        waves: waves of the texture; their shares sum to at most 1 / tone - 1, so that nothing is
            clipped.
    """

    category: int | None
    a: float
    b: float
    power: float
    petals: int
    petal: float
    x: float
    y: float
    z: float
    swing: float
    heading: float
    rate: float
    phase: float
    pump: float
    pump_phase: float
    turn: float
    spin: float
    tilt: float
    tilt_axis: float
    tone: float
    waves: tuple[Wave, ...]

    @property
    def reach(self) -> float:
        """Largest distance of a point from the centre, m. A rectangle's corner is 2^(1/2 - 1/n)
        times the longer semi-axis away, at most."""
        corner = 2 ** max(0.5 - 1 / self.power, 0.0)
        return (1 + self.petal) * max(self.a, self.b) * corner

    @property
    def area(self) -> float:
        """Area in its own plane, m². The superellipse has 4 a b Γ(1 + 1/n)² / Γ(1 + 2/n); petals
        on an ellipse add π a b petal² / 2."""
        gamma = math.gamma(1 + 1 / self.power) ** 2 / math.gamma(1 + 2 / self.power)
        return 4 * self.a * self.b * gamma * (1 + self.petal**2 / 2)

    def centre(self, t: float) -> tuple[float, float, float]:
        """T, m, at the instant t, s."""
        along = self.swing * math.sin(self.rate * t + self.phase)
        deep = self.pump * math.sin(self.rate * t + self.pump_phase)
        return (
            self.x + along * math.cos(self.heading), self.y + along * math.sin(self.heading),
            self.z + deep,
        )  # fmt: skip

    @cached_property
    def slant(self) -> Matrix:
        """The tilt, (3, 3), by the formula of Rodrigues."""
        kx, ky = math.cos(self.tilt_axis), math.sin(self.tilt_axis)
        cross = np.array([[0, 0, ky], [0, 0, -kx], [-ky, kx, 0.0]])
        return np.eye(3) + math.sin(self.tilt) * cross + (1 - math.cos(self.tilt)) * cross @ cross

    def axes(self, t: float) -> Matrix:
        """The first two columns of R at t, (3, 2): a turn in the plane, then the tilt."""
        angle = self.turn + math.fmod(self.spin * t, 2 * math.pi)
        cos, sin = math.cos(angle), math.sin(angle)
        return self.slant @ np.array([[cos, -sin], [sin, cos], [0.0, 0.0]])

    def homography(self, t: float, shape: tuple[int, int]) -> Matrix:
        """H at t, (3, 3): H (u, v, 1) = Pz (x, y, 1)."""
        return intrinsics(shape) @ np.column_stack([self.axes(t), self.centre(t)])

    def depths(self) -> tuple[float, float]:
        """Least and greatest depth that a point of the plate can have at any time, m."""
        half = self.pump + self.reach * abs(math.sin(self.tilt))
        return self.z - half, self.z + half

    def speed(self, shape: tuple[int, int]) -> float:
        """Upper bound of the speed of its points within the picture, pixels/s: with |Px| / Pz and
        |Py| / Pz at most those of the picture's corner, |ẋ| ≤ (F |Ṗ| + corner |Ṗz|) / Pz."""
        near = self.depths()[0]
        turning = abs(self.spin) * self.reach
        across = abs(self.rate) * self.swing + turning
        deep = abs(self.rate) * self.pump + turning * abs(math.sin(self.tilt))
        corner = 0.5 * math.hypot(*shape)
        return (FOCAL * min(shape) * across + corner * deep) / near
