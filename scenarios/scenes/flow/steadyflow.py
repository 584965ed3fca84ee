"""Density of the steady flow at Mach 5 to 7 past a wedge and past a sphere on a sting.

Lengths are in metres; x points downstream from the foremost point of the model, y from its axis.
Densities are relative to the free stream. A model consists of the forebody, a straight afterbody, a
flat base, and a thinner sting that extends beyond the picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from scenarios.scenes.flow.gasdynamics import (
    GAMMA,
    GAS,
    Fan,
    Gas,
    behind_normal,
    behind_oblique,
    billig_curvature,
    billig_standoff,
    fan,
    shock_angle,
    stagnation_ratio,
)

Array = npt.NDArray[np.float64]

STING = 0.4
"""Half height of the sting over that of the base (assumed)."""
BASE_TURN = math.radians(12.0)
"""Inward deflection of the flow at the edge of the base, rad (assumed: the base pressure of such
wakes is a fifth to a third of the pressure ahead)."""
WAKE_DENSITY, WAKE_SPREAD = 0.35, 0.06
"""Density of the dead air behind the base over that of the outer flow, and growth of the mixing
layer per length (assumed)."""
WALL = 300.0
"""Temperature of the model's surface, K; a short run does not heat it."""


def viscosity(temperature: float) -> float:
    """Sutherland's law for air (NACA Report 1135, appendix B), Pa s."""
    return 1.458e-6 * temperature**1.5 / (temperature + 110.4)


def _rays(waves: Fan, angle: Any, field: Any) -> Any:
    """A quantity of a fan along rays at `angle`, constant beyond its ends."""
    return np.interp(angle, waves.angle[::-1], field[::-1])


def _turn_back(waves: Fan, height: float) -> tuple[float, float, float]:
    """The shock that turns the flow parallel to the sting behind the fan of the base
    (theta-beta-M): the distance of its origin from the base, m, its slope, and the density ratio
    across it."""
    mach, inwards = float(waves.mach[-1]), -float(waves.direction[-1])
    beta = shock_angle(mach, inwards)
    far = (1.0 - STING) * height / math.tan(inwards)
    return far, math.tan(beta - inwards), behind_oblique(mach, beta, inwards)[1]


def _base(waves: Fan, x: Array, y: Array, height: float) -> Array:
    """Factor on the density behind a base whose edge is at (0, height): the fan, the dead air, the
    shock at the sting, and the wake behind it."""
    factor = _rays(waves, np.arctan2(y - height, x), waves.density)
    factor = np.where(x <= 0.0, 1.0, factor)
    meets, slope, back = _turn_back(waves, height)
    sting, direction = STING * height, float(waves.direction[-1])
    inside = (x > meets) & (y < sting + (x - meets) * slope)
    factor = np.where(inside, factor * back, factor)
    # The dead air, and the hot wake downstream of it along the sting.
    edge = np.maximum(height + x * math.tan(direction), sting)
    soft = WAKE_SPREAD * np.maximum(x, 0.0) + 1e-4
    part = 1.0 / (1.0 + np.exp(np.clip((y - edge) / (0.25 * soft), -50, 50)))
    fade = np.where(x > meets, np.exp(-np.maximum(x - meets, 0.0) / (4.0 * height)), 1.0)
    dead = WAKE_DENSITY * float(waves.density[-1]) * np.where(inside, back, 1.0)
    level = factor + fade * (dead - factor)
    return np.where(x > 0.0, factor + part * (level - factor), factor)


@dataclass(frozen=True)
class Wedge:
    """A two-dimensional wedge with an afterbody.

    The attached shock (theta-beta-M), the uniform flow behind it, and the centred fan at the
    shoulder are exact. Where the fan weakens the shock, shock-expansion theory applies (Eggers,
    Syvertson and Kraus, NACA Report 1123, 1953): each ray of the fan sets the flow direction at the
    shock; rays reflected from the shock are neglected.

    Attributes:
        stream: free stream.
        angle: half angle, rad.
        length, afterbody: lengths of wedge and afterbody, m.
    """

    stream: Gas
    angle: float
    length: float
    afterbody: float

    @property
    def height(self) -> float:
        return self.length * math.tan(self.angle)

    @property
    def base(self) -> float:
        """x of the base, m."""
        return self.length + self.afterbody

    @cached_property
    def beta(self) -> float:
        return shock_angle(self.stream.mach, self.angle)

    @cached_property
    def behind(self) -> tuple[float, float, float]:
        """Pressure ratio, density ratio and Mach number behind the shock."""
        return behind_oblique(self.stream.mach, self.beta, self.angle)

    @cached_property
    def shoulder(self) -> Fan:
        return fan(self.behind[2], self.angle, self.angle)

    @cached_property
    def after(self) -> Fan:
        """The fan at the edge of the base."""
        return fan(float(self.shoulder.mach[-1]), 0.0, BASE_TURN)

    @cached_property
    def shock(self) -> tuple[Array, Array]:
        """Points x, y of the shock, a polygon, m. At each point a ray of the fan meets the shock;
        beyond it, the shock deflects the stream to the direction of this ray."""
        waves, x0, y0 = self.shoulder, self.length, self.height
        xs, ys = [0.0], [0.0]
        slope = math.tan(self.beta)
        for ray, flow in zip(waves.angle, waves.direction, strict=True):
            steep = math.tan(ray)
            if steep <= slope:
                break  # this ray never meets the shock
            x = (y0 - steep * x0 - ys[-1] + slope * xs[-1]) / (slope - steep)
            ys.append(ys[-1] + slope * (x - xs[-1]))
            xs.append(x)
            slope = math.tan(shock_angle(self.stream.mach, max(float(flow), 0.0)))
        far = xs[-1] + 10.0
        return np.array([*xs, far]), np.array([*ys, ys[-1] + slope * 10.0])

    def surface(self, x: Array) -> Array:
        """Half height of the body at x, m; 0 upstream of it."""
        nose = np.clip(x, 0.0, self.length) * math.tan(self.angle)
        return np.where(x > self.base, STING * self.height, nose)

    def front(self, y: Array) -> Array:
        """x of the shock at the distance y from the axis, m."""
        xs, ys = self.shock
        return np.interp(np.abs(y), ys, xs)

    def density(self, x: Array, y: Array) -> Array:
        """Density at points, with broadcasting; inside the body, the density at its surface."""
        y = np.maximum(np.abs(y), self.surface(x))
        xs, ys = self.shock
        waves = self.shoulder
        ray = np.arctan2(y - self.height, x - self.length)
        expanded = np.where(x > self.length, _rays(waves, ray, waves.density), 1.0)
        rho = self.behind[1] * expanded
        rho = rho * _base(self.after, x - self.base, y, self.height)
        rho = rho * self._layer(x, y)
        outside = (x <= 0.0) | (y > np.interp(x, xs, ys))
        return np.where(outside, 1.0, rho)

    def _layer(self, x: Array, y: Array) -> Array:
        """Factor of the boundary layer on the density. The layer is laminar, as in a quiet tunnel,
        with a thickness of x/sqrt(Re) (5 + (0.2 + 0.9 Tw/Taw)(gamma - 1) M^2) (White, Viscous Fluid
        Flow, chapter 7), a linear velocity profile, and a temperature profile by Crocco and
        Busemann."""
        p, rho, mach = self.behind
        stream = self.stream
        cold = stream.temperature * p / rho
        speed = mach * math.sqrt(GAMMA * GAS * cold)
        per_metre = rho * stream.density * speed / viscosity(cold)
        adiabatic = cold * (1.0 + 0.85 * (stagnation_ratio(mach) - 1.0))  # recovery factor 0.85
        grow = 5.0 + (0.2 + 0.9 * WALL / adiabatic) * (GAMMA - 1.0) * mach * mach
        along = np.clip(x, 0.0, self.base) / math.cos(self.angle)
        thick = grow * np.sqrt(along / per_metre) + 1e-9
        # Behind the base the layer follows the flow and decays over a third of the height.
        beyond = np.maximum(x - self.base, 0.0)
        edge = self.surface(np.minimum(x, self.base)) - beyond * math.tan(BASE_TURN)
        u = np.clip((y - edge) / thick, 0.0, 1.0)
        ratio = (WALL + (adiabatic - WALL) * u) / cold - (adiabatic / cold - 1.0) * u * u
        return np.where(
            x > 0.0, 1.0 + (1.0 / ratio - 1.0) * np.exp(-3.0 * beyond / self.height), 1.0
        )

    def path(self, x: Array, y: Array, width: float, swell: float = 1.0) -> Array:
        """Excess density integrated along sight lines of the length `width`, m, the span of the
        wedge."""
        return width * (self.density(x, y) - 1.0)


# A compiled kernel has separate arguments: unpacking a record of arrays would cost time in each
# call.
@njit(cache=True, nogil=True)
def _layer_density(  # type: ignore[no-untyped-def]
    x, r, radius, off, curve, slope, gamma, mach, stag, pitot, corner, wake, rays, ratios
):
    """Density between the bow shock of a sphere and its surface, at one point. `gamma` is an
    argument, because a cached compilation would keep an old value of the constant."""
    root = math.sqrt(1.0 + (r * slope / curve) ** 2)
    front = -off + curve / (slope * slope) * (root - 1.0)
    if x <= front:
        return 1.0
    steep = r / (curve * root)  # dx/dr of the shock
    sine2 = 1.0 / (1.0 + steep * steep)
    m2 = max(mach * mach * sine2, 1.0)
    ahead = (gamma + 1.0) * m2 / ((gamma - 1.0) * m2 + 2.0)
    if x < radius:
        far = math.hypot(x - radius, r)
        gap = far - radius
        toward = (radius - x) / max(far, 1e-12)  # sine of the surface's slope
    else:
        gap, toward = r - radius, 0.0
    gap = max(gap, 0.0)
    newton = 1.0 + (pitot - 1.0) * toward * toward
    wall = stag * (newton / pitot) ** (1.0 / gamma)
    depth = (x - front) * math.sqrt(sine2)
    part = gap / max(gap + depth, 1e-12)
    rho = wall + part * (ahead - wall)
    if x > corner:
        falls, sting, meets, rise, back, dead = wake
        behind = x - corner
        rho *= np.interp(math.atan2(r - radius, behind), rays, ratios)
        if r < radius - falls * behind:
            rho = dead
        if behind > meets and r < sting + rise * (behind - meets):
            rho *= back
    return rho


@njit(cache=True, nogil=True)
def _path(x, y, out, steps, radius, off, curve, slope, *rest):  # type: ignore[no-untyped-def]
    """Fills `out` with twice the integral of (density - 1) along z from 0 to the shock, m, by the
    midpoint rule."""
    for i in range(y.size):
        for j in range(x.size):
            reach = (x[j] + off) * slope * slope / curve + 1.0
            out[i, j] = 0.0
            if reach <= 1.0:
                continue
            z2 = (reach * reach - 1.0) * (curve / slope) ** 2 - y[i] * y[i]
            if z2 <= 0.0:
                continue
            step = math.sqrt(z2) / steps
            total = 0.0
            for k in range(steps):
                r = math.hypot(y[i], (k + 0.5) * step)
                total += _layer_density(x[j], r, radius, off, curve, slope, *rest) - 1.0
            out[i, j] = 2.0 * step * total


@dataclass(frozen=True)
class Sphere:
    """A hemisphere with a cylindrical afterbody.

    Standoff and shape of the bow shock follow Billig's correlation; the density behind it is that
    of the local oblique shock. The density at the surface follows from the modified Newtonian
    pressure with Rayleigh's pitot pressure (NACA 1135, 100), expanded isentropically from the
    stagnation point. The linear profile between the two, and the wake, are models.

    Attributes:
        stream: free stream.
        radius, afterbody: radius of the sphere and length of the afterbody, m.
    """

    stream: Gas
    radius: float
    afterbody: float

    @property
    def height(self) -> float:
        return self.radius

    @property
    def base(self) -> float:
        return self.radius + self.afterbody

    @property
    def standoff(self) -> float:
        return self.radius * billig_standoff(self.stream.mach)

    @property
    def stagnation(self) -> tuple[float, float]:
        """Density and pressure at the stagnation point, over those of the free stream."""
        p, rho, _, after = behind_normal(self.stream.mach)
        ratio = stagnation_ratio(after)
        return rho * ratio ** (1.0 / (GAMMA - 1.0)), p * ratio ** (GAMMA / (GAMMA - 1.0))

    @cached_property
    def after(self) -> Fan:
        """The fan at the edge of the base. Along the cylinder, the flow has expanded from the
        stagnation point to the pressure of the free stream."""
        pitot = self.stagnation[1]
        mach = math.sqrt((pitot ** ((GAMMA - 1.0) / GAMMA) - 1.0) * 2.0 / (GAMMA - 1.0))
        return fan(mach, 0.0, BASE_TURN)

    def surface(self, x: Array) -> Array:
        inside = np.clip(x, 0.0, self.radius)
        nose = np.sqrt(np.maximum(inside * (2.0 * self.radius - inside), 0.0))
        return np.where(x > self.base, STING * self.radius, nose)

    def _shape(self, swell: float) -> tuple[float, float, float]:
        """Standoff, m, radius of curvature, m, and tangent of the asymptotic angle (the Mach angle)
        of a shock with the standoff times `swell`."""
        curve = swell * self.radius * billig_curvature(self.stream.mach)
        return swell * self.standoff, curve, math.tan(math.asin(1.0 / self.stream.mach))

    def front(self, y: Array, swell: float = 1.0) -> Array:
        """x of the bow shock, a hyperbola (Anderson 5.36), m."""
        off, curve, slope = self._shape(swell)
        return -off + curve / slope**2 * (np.sqrt(1.0 + (y * slope / curve) ** 2) - 1.0)

    def path(self, x: Array, y: Array, width: float, swell: float = 1.0, steps: int = 40) -> Array:
        """Excess density integrated along sight lines, m, (H, W), for x (1, W) and y (H, 1). Every
        sight line crosses the whole flow, so `width` has no effect."""
        stag, pitot = self.stagnation
        waves = self.after
        out = np.empty((y.size, x.size))
        rays, ratios = waves.angle[::-1].copy(), waves.density[::-1].copy()
        wall = stag * pitot ** (-1.0 / GAMMA)  # along the cylinder
        wake = (
            math.tan(BASE_TURN), STING * self.radius, *_turn_back(waves, self.radius),
            WAKE_DENSITY * wall * float(waves.density[-1]),
        )  # fmt: skip
        _path(
            x.ravel(), np.abs(y).ravel(), out, steps, self.radius, *self._shape(swell),
            GAMMA, self.stream.mach, stag, pitot, self.base, wake, rays, ratios,
        )  # fmt: skip
        return out
