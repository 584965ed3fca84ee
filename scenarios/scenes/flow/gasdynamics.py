"""Relations of one-dimensional and two-dimensional gas dynamics, for air as a perfect gas.

Shocks and isentropic flow: NACA Report 1135 (Ames staff, Equations, Tables, and Charts for
Compressible Flow, 1953), whose equation numbers are given. Bow shocks: Billig, Shock-Wave Shapes
around Spherical- and Cylindrical-Nosed Bodies, J. Spacecraft 4:822, 1967, as printed by Anderson,
Hypersonic and High Temperature Gas Dynamics, section 5.4. Angles are radians, everything else SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

GAMMA = 1.4
"""Ratio of specific heats of air below some 600 K."""
GAS = 287.05
"""Specific gas constant of dry air, J/(kg K) (ICAO standard atmosphere)."""


@dataclass(frozen=True)
class Gas:
    """A uniform state of the gas.

    Attributes:
        pressure: static pressure, Pa.
        density: density, kg/m3.
        velocity: velocity along x, m/s.
    """

    pressure: float
    density: float
    velocity: float

    @property
    def temperature(self) -> float:
        return self.pressure / (self.density * GAS)

    @property
    def sound(self) -> float:
        """Speed of sound, m/s."""
        return math.sqrt(GAMMA * self.pressure / self.density)

    @property
    def mach(self) -> float:
        return self.velocity / self.sound


def stagnation_ratio(mach: Any) -> Any:
    """Stagnation temperature over temperature, 1 + (gamma - 1)/2 M^2 (43). The ratio of pressures
    is its power gamma/(gamma - 1), that of densities its power 1/(gamma - 1)."""
    return 1.0 + 0.5 * (GAMMA - 1.0) * mach * mach


def nozzle(mach: float, pressure: float, temperature: float) -> Gas:
    """The flow of a nozzle at this Mach number, from a stagnation pressure, Pa, and temperature,
    K."""
    ratio = stagnation_ratio(mach)
    static, cold = pressure * ratio ** (-GAMMA / (GAMMA - 1.0)), temperature / ratio
    return Gas(static, static / (GAS * cold), mach * math.sqrt(GAMMA * GAS * cold))


def behind_normal(mach: float) -> tuple[float, float, float, float]:
    """Pressure, density and temperature ratio across a normal shock, and the Mach number behind it
    (Rankine-Hugoniot, 93 to 96). Mach numbers are relative to the shock; `mach` is at least 1."""
    m2 = mach * mach
    p = (2.0 * GAMMA * m2 - (GAMMA - 1.0)) / (GAMMA + 1.0)
    rho = (GAMMA + 1.0) * m2 / ((GAMMA - 1.0) * m2 + 2.0)
    after = math.sqrt(((GAMMA - 1.0) * m2 + 2.0) / (2.0 * GAMMA * m2 - (GAMMA - 1.0)))
    return p, rho, p / rho, after


def shock_mach(ratio: float) -> float:
    """Mach number of the normal shock with the pressure ratio `ratio` (93)."""
    return math.sqrt(((GAMMA + 1.0) * ratio + (GAMMA - 1.0)) / (2.0 * GAMMA))


def reflected(ratio: float) -> float:
    """Pressure ratio of the shock reflected at a wall, behind which the gas is at rest. The
    incident shock has the pressure ratio `ratio` and runs into gas at rest (Anderson, Modern
    Compressible Flow, section 7.3)."""
    above, below = GAMMA + 1.0, GAMMA - 1.0
    return ((2.0 * GAMMA + below) * ratio - below) / (below * ratio + above)


def _deflection(mach: float, beta: float) -> float:
    """Angle by which a shock at the angle `beta` deflects the flow (theta-beta-M)."""
    m2, s = mach * mach, math.sin(beta) ** 2
    return math.atan2(
        2.0 * (m2 * s - 1.0) / math.tan(beta), m2 * (GAMMA + math.cos(2.0 * beta)) + 2.0
    )


def detachment(mach: float) -> tuple[float, float]:
    """(deflection, shock angle) at which the flow behind an attached oblique shock is sonic (167):
    slightly below the greatest deflection, at which the shock detaches."""
    m2 = mach * mach
    g1, g3 = GAMMA + 1.0, 3.0 - GAMMA
    root = math.sqrt(g1 * (g1 * m2 * m2 / 16.0 - g3 * m2 / 8.0 + (GAMMA + 9.0) / 16.0))
    beta = math.asin(math.sqrt((g1 * m2 / 4.0 - g3 / 4.0 + root) / (GAMMA * m2)))
    return _deflection(mach, beta), beta


def shock_angle(mach: float, deflection: float) -> float:
    """Angle of the weak oblique shock that deflects the flow by `deflection` (theta-beta-M). Raises
    ValueError if no attached shock with supersonic flow behind it exists."""
    most, beta = detachment(mach)
    if not 0.0 <= deflection <= most:
        raise ValueError(
            f"deflection must be 0 to {math.degrees(most):.2f} deg for an attached shock at Mach "
            f"{mach:g}, not {math.degrees(deflection):.2f}"
        )
    low = math.asin(1.0 / mach)
    if deflection == 0.0:
        return low
    if deflection == most:
        return beta
    root = brentq(lambda b: _deflection(mach, b) - deflection, low, beta, xtol=1e-14)
    return float(root)


def behind_oblique(mach: float, beta: float, deflection: float) -> tuple[float, float, float]:
    """Pressure and density ratio across an oblique shock, and the Mach number behind it."""
    p, rho, _, normal = behind_normal(mach * math.sin(beta))
    return p, rho, normal / math.sin(beta - deflection)


def prandtl_meyer(mach: Any) -> Any:
    """The Prandtl-Meyer angle nu, through which sonic flow expands to this Mach number (171c)."""
    k = math.sqrt((GAMMA + 1.0) / (GAMMA - 1.0))
    root = np.sqrt(np.asarray(mach, np.float64) ** 2 - 1.0)
    return k * np.arctan(root / k) - np.arctan(root)


@dataclass(frozen=True, eq=False)
class Fan:
    """A centred expansion fan, as n rays. Angles are relative to the x axis.

    Attributes:
        angle: angle of the ray, decreasing, (n,).
        direction: direction of the flow on the ray, (n,).
        mach: Mach number on the ray, (n,).
        density: density on the ray over that before the fan, (n,).
    """

    angle: Any
    direction: Any
    mach: Any
    density: Any


def fan(mach: float, direction: float, turn: float, n: int = 200) -> Fan:
    """The fan that deflects a flow by `turn` > 0 towards smaller angles: nu(M) = nu(mach) + turn
    (171c), isentropic (43 to 45).

    Args:
        mach, direction: Mach number and direction of the flow before the fan.
        turn: deflection.
        n: number of rays.
    """
    first = float(prandtl_meyer(mach))
    last = float(brentq(lambda m: float(prandtl_meyer(m)) - first - turn, mach, 1e3, xtol=1e-12))
    machs = np.linspace(mach, last, n)
    flow = direction - (prandtl_meyer(machs) - first)
    ratio = stagnation_ratio(mach) / stagnation_ratio(machs)
    return Fan(flow + np.arcsin(1.0 / machs), flow, machs, ratio ** (1.0 / (GAMMA - 1.0)))


def billig_standoff(mach: float) -> float:
    """Standoff of the bow shock of a sphere over its radius: 0.143 exp(3.24/M^2)."""
    return 0.143 * math.exp(3.24 / (mach * mach))


def billig_curvature(mach: float) -> float:
    """Radius of curvature of the bow shock on the axis over the radius of the sphere: 1.143
    exp(0.54/(M - 1)^1.2)."""
    return 1.143 * math.exp(0.54 / (mach - 1.0) ** 1.2)


@dataclass(frozen=True)
class Start:
    """The waves at the start of a tunnel, and the gas between them, from upstream to downstream:
    flow | starting shock | cold | contact, at cold.velocity | hot | primary shock | rest.

    Attributes:
        flow: flow of the nozzle.
        cold: gas of the nozzle behind the starting shock.
        hot: gas of the chamber behind the primary shock.
        rest: gas of the chamber at rest.
        starting: speed of the starting shock, m/s.
        primary: speed of the primary shock, m/s.
    """

    flow: Gas
    cold: Gas
    hot: Gas
    rest: Gas
    starting: float
    primary: float


def start_flow(flow: Gas, chamber: float, temperature: float) -> Start:
    """The exact solution of the Riemann problem between the flow of the nozzle and gas at rest
    (Toro, Riemann Solvers and Numerical Methods for Fluid Dynamics, 3rd ed., section 4.2).

    It has the waves that are known of starting nozzles: a primary shock, a contact, and a second
    shock that faces upstream and is swept downstream (Smith, J. Fluid Mech. 24:625, 1966). The
    model is one-dimensional and neglects the starting time of the nozzle itself.

    Args:
        flow: flow of the nozzle.
        chamber, temperature: pressure, Pa, and temperature, K, of the gas at rest.

    Raises:
        ValueError: one of the waves is not a shock, or the starting shock would move upstream into
            the nozzle: the tunnel does not start.
    """
    rest = Gas(chamber, chamber / (GAS * temperature), 0.0)

    def speed(gas: Gas, p: float) -> float:
        """Change of velocity across a shock from `gas` to the pressure p (Toro 4.6), m/s."""
        a = 2.0 / ((GAMMA + 1.0) * gas.density)
        b = (GAMMA - 1.0) / (GAMMA + 1.0) * gas.pressure
        return (p - gas.pressure) * math.sqrt(a / (p + b))

    def excess(p: float) -> float:
        return flow.velocity - speed(flow, p) - speed(rest, p)

    low, high = max(flow.pressure, rest.pressure), flow.pressure * behind_normal(flow.mach)[0]
    if low >= high or excess(high) >= 0.0 or excess(low) <= 0.0:
        # At `high` the starting shock is stationary; a higher pressure would drive it upstream.
        raise ValueError(
            f"the chamber must be at {flow.pressure:.0f} to "
            f"{stalling(flow, temperature):.0f} Pa, not {chamber:.0f}"
        )
    p = float(brentq(excess, low, high, xtol=1e-9))
    velocity = speed(rest, p)

    def side(gas: Gas) -> tuple[Gas, float]:
        """The gas behind a shock, and the Mach number of the shock relative to the gas before
        it."""
        mach = shock_mach(p / gas.pressure)
        return Gas(p, gas.density * behind_normal(mach)[1], velocity), mach

    cold, against = side(flow)
    hot, along = side(rest)
    return Start(flow, cold, hot, rest, flow.velocity - against * flow.sound, along * rest.sound)


def stalling(flow: Gas, temperature: float) -> float:
    """The pressure of the chamber at which the starting shock would be stationary, Pa: the gas
    behind it then has the velocity that the primary shock gives to the gas at rest."""
    p, ratio, _, _ = behind_normal(flow.mach)
    p, velocity = p * flow.pressure, flow.velocity / ratio

    def excess(chamber: float) -> float:
        density = chamber / (GAS * temperature)
        a, b = 2.0 / ((GAMMA + 1.0) * density), (GAMMA - 1.0) / (GAMMA + 1.0) * chamber
        return (p - chamber) * math.sqrt(a / (p + b)) - velocity

    return float(brentq(excess, 1e-4 * p, p))
