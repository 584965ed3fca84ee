"""Steady flow of a Mach 5 to 7 stream past a wedge and past a sphere on a sting: its density.

Lengths in metres, x downstream from the model's foremost point, y from its axis; densities over
that of the free stream. Each model is the forebody, a straight afterbody, a flat base and a thinner
sting that runs out of the picture.
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

__all__ = ["BASE_TURN", "STING", "Sphere", "Wedge", "viscosity"]

Array = npt.NDArray[np.float64]

STING = 0.4
"""Sting's half height over the base's (assumed)."""
BASE_TURN = math.radians(12.0)
"""The flow turns inwards by this at the base's edge (assumed: base pressure a fifth to a third of
that ahead of it, as wakes of this kind show)."""
WAKE_DENSITY, WAKE_SPREAD = 0.35, 0.06
"""Dead air behind the base: its density over that of the flow along it, being hotter, and the
growth of the layer between the two, per length (assumed)."""
WALL = 300.0
"""Temperature of the model's surface, K: a short run does not heat it."""


def viscosity(temperature: float) -> float:
    """Sutherland's law for air (NACA Report 1135, appendix B), Pa s."""
    return 1.458e-6 * temperature**1.5 / (temperature + 110.4)


def _rays(waves: Fan, angle: Any, field: Any) -> Any:
    """What a fan holds along rays at `angle`; its ends go on beyond."""
    return np.interp(angle, waves.angle[::-1], field[::-1])


def _turn_back(waves: Fan, height: float) -> tuple[float, float, float]:
    """The shock that turns the flow along the sting after a base's fan (theta-beta-M): how far
    behind the base it begins, its slope, and the density ratio across it."""
    mach, inwards = float(waves.mach[-1]), -float(waves.direction[-1])
    beta = shock_angle(mach, inwards)
    far = (1.0 - STING) * height / math.tan(inwards)
    return far, math.tan(beta - inwards), behind_oblique(mach, beta, inwards)[1]


def _base(waves: Fan, x: Array, y: Array, height: float) -> Array:
    """Factor on the density behind a base whose edge lies at (0, height): the fan, the dead air,
    the shock that turns the flow back along the sting, and the wake behind it."""
    factor = _rays(waves, np.arctan2(y - height, x), waves.density)
    factor = np.where(x <= 0.0, 1.0, factor)
    meets, slope, back = _turn_back(waves, height)
    sting, direction = STING * height, float(waves.direction[-1])
    inside = (x > meets) & (y < sting + (x - meets) * slope)
    factor = np.where(inside, factor * back, factor)
    # Dead air, and the hot wake that goes on from it over the sting.
    edge = np.maximum(height + x * math.tan(direction), sting)
    soft = WAKE_SPREAD * np.maximum(x, 0.0) + 1e-4
    part = 1.0 / (1.0 + np.exp(np.clip((y - edge) / (0.25 * soft), -50, 50)))
    fade = np.where(x > meets, np.exp(-np.maximum(x - meets, 0.0) / (4.0 * height)), 1.0)
    dead = WAKE_DENSITY * float(waves.density[-1]) * np.where(inside, back, 1.0)
    level = factor + fade * (dead - factor)
    return np.where(x > 0.0, factor + part * (level - factor), factor)


@dataclass(frozen=True)
class Wedge:
    """A wedge of half angle `angle` and `length`, two-dimensional, with an afterbody.

    Exact: the attached shock (theta-beta-M) and the uniform flow behind it, the centred fan at the
    shoulder. Shock-expansion theory (Eggers, Syvertson and Kraus, NACA Report 1123, 1953): the
    shock where the fan weakens it, by the flow direction that each ray of the fan brings, rays that
    come back from the shock being left out.
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
        """Where the base stands."""
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
        """The fan at the base's edge."""
        return fan(float(self.shoulder.mach[-1]), 0.0, BASE_TURN)

    @cached_property
    def shock(self) -> tuple[Array, Array]:
        """Points (x, y) of the shock, straight between them: where each ray of the fan meets it,
        and the angle that turns the stream to that ray's direction beyond."""
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
        """Half height of the body; 0 before it."""
        nose = np.clip(x, 0.0, self.length) * math.tan(self.angle)
        return np.where(x > self.base, STING * self.height, nose)

    def front(self, y: Array) -> Array:
        """x of the shock at a distance y from the axis."""
        xs, ys = self.shock
        return np.interp(np.abs(y), ys, xs)

    def density(self, x: Array, y: Array) -> Array:
        """Density at points, broadcast; within the body that at its surface."""
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
        """The laminar boundary layer's factor on the density: thickness x/sqrt(Re) (5 + (0.2 +
        0.9 Tw/Taw)(gamma - 1) M^2) (White, Viscous Fluid Flow, chapter 7), velocity taken as
        linear across it, temperature by Crocco and Busemann. A laminar one: a quiet tunnel's."""
        p, rho, mach = self.behind
        stream = self.stream
        cold = stream.temperature * p / rho
        speed = mach * math.sqrt(GAMMA * GAS * cold)
        per_metre = rho * stream.density * speed / viscosity(cold)
        adiabatic = cold * (1.0 + 0.85 * (stagnation_ratio(mach) - 1.0))  # recovery factor 0.85
        grow = 5.0 + (0.2 + 0.9 * WALL / adiabatic) * (GAMMA - 1.0) * mach * mach
        along = np.clip(x, 0.0, self.base) / math.cos(self.angle)
        thick = grow * np.sqrt(along / per_metre) + 1e-9
        # Beyond the base the layer leaves with the flow, and mixes away in the height's third.
        beyond = np.maximum(x - self.base, 0.0)
        edge = self.surface(np.minimum(x, self.base)) - beyond * math.tan(BASE_TURN)
        u = np.clip((y - edge) / thick, 0.0, 1.0)
        ratio = (WALL + (adiabatic - WALL) * u) / cold - (adiabatic / cold - 1.0) * u * u
        return np.where(
            x > 0.0, 1.0 + (1.0 / ratio - 1.0) * np.exp(-3.0 * beyond / self.height), 1.0
        )

    def path(self, x: Array, y: Array, width: float, swell: float = 1.0) -> Array:
        """Density less the free stream's, times metres of sight line: width is the wedge's span."""
        return width * (self.density(x, y) - 1.0)


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True)
def _layer_density(  # type: ignore[no-untyped-def]
    x, r, radius, off, curve, slope, gamma, mach, stag, pitot, corner, wake, rays, ratios
):
    """Density between a sphere's bow shock and its surface, at one point. gamma is an argument, for
    a compiled loop from the cache would keep the constant of its own day."""
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


@njit(cache=True)
def _path(x, y, out, steps, radius, off, curve, slope, *rest):  # type: ignore[no-untyped-def]
    """2 x the integral of (density - 1) along z from 0 to the shock, midpoints of equal steps."""
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
    """A hemisphere of `radius` with a cylindrical afterbody, of revolution.

    The bow shock's standoff and shape are Billig's correlation, the density just behind it that of
    the local oblique shock. Along the surface: modified Newtonian pressure from Rayleigh's pitot
    pressure (NACA 1135, 100), expanded isentropically from the stagnation point. Between the two,
    linear across the layer, and the wake: models.
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
        """Density and pressure at the stagnation point over the free stream's."""
        p, rho, _, after = behind_normal(self.stream.mach)
        ratio = stagnation_ratio(after)
        return rho * ratio ** (1.0 / (GAMMA - 1.0)), p * ratio ** (GAMMA / (GAMMA - 1.0))

    @cached_property
    def after(self) -> Fan:
        """The fan at the base's edge; the flow along the cylinder has come from the stagnation
        point to the free stream's pressure."""
        pitot = self.stagnation[1]
        mach = math.sqrt((pitot ** ((GAMMA - 1.0) / GAMMA) - 1.0) * 2.0 / (GAMMA - 1.0))
        return fan(mach, 0.0, BASE_TURN)

    def surface(self, x: Array) -> Array:
        inside = np.clip(x, 0.0, self.radius)
        nose = np.sqrt(np.maximum(inside * (2.0 * self.radius - inside), 0.0))
        return np.where(x > self.base, STING * self.radius, nose)

    def _shape(self, swell: float) -> tuple[float, float, float]:
        """Standoff, radius of curvature and tan of the far angle, the Mach angle, of a shock
        `swell` times as far out as the steady one."""
        curve = swell * self.radius * billig_curvature(self.stream.mach)
        return swell * self.standoff, curve, math.tan(math.asin(1.0 / self.stream.mach))

    def front(self, y: Array, swell: float = 1.0) -> Array:
        """x of the bow shock (Anderson 5.36): a hyperbola."""
        off, curve, slope = self._shape(swell)
        return -off + curve / slope**2 * (np.sqrt(1.0 + (y * slope / curve) ** 2) - 1.0)

    def path(self, x: Array, y: Array, width: float, swell: float = 1.0, steps: int = 40) -> Array:
        """Density less the free stream's, integrated along sight lines: metres. x (1, w), y (h, 1);
        every sight line crosses the whole flow, so `width` does not matter."""
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
