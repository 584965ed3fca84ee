"""How long steady light goes without a false report: the first passage of an Ornstein-Uhlenbeck
process out of a band.

Times are in time constants, bounds in standard deviations of the stationary process.
"""

from __future__ import annotations

import math

import numpy as np


def exit_time(bound: float) -> float:
    """Mean time from the mean to +-bound, watched without pause.

    T = sqrt(pi/2) int_0^bound e^(z^2/2) erf(z/sqrt 2) dz, the solution of T'' - z T' = -1 with
    T'(0) = 0 and T(bound) = 0 (Siegert, "On the first passage time probability problem",
    Phys. Rev. 81:617, 1951). Raises ValueError for bounds below 0 or above 35, beyond float64.
    """
    from scipy.integrate import quad

    if not 0 <= bound <= 35:
        raise ValueError(f"bound must be from 0 to 35 standard deviations, not {bound:g}")
    value, _ = quad(
        lambda z: math.exp(z * z / 2) * math.erf(z / math.sqrt(2)), 0, bound, epsrel=1e-11
    )
    return math.sqrt(math.pi / 2) * float(value)


def sampled_exit_time(bound: float, step: float, nodes: int = 400) -> float:
    """The same where the process is looked at every `step` time constants, first after one step.

    T(x) = step + int_-bound^bound p(x -> y) T(y) dy with p normal of mean x e^-step and variance
    1 - e^(-2 step), solved on Gauss-Legendre nodes (Nystroem). For small steps it comes to
    `exit_time` of a bound that is 0.5826 sqrt(2 step) farther (Broadie, Glasserman, Kou, "A
    continuity correction for discrete barrier options", Math. Finance 7:325, 1997).

    Raises ValueError where `nodes` are too coarse for the step.
    """
    a, spread = math.exp(-step), math.sqrt(-math.expm1(-2 * step))
    if not (0 < bound < math.inf and 0 < step < math.inf) or 2 * bound / nodes > spread / 2:
        raise ValueError(f"bound and step must be above 0 and {nodes} nodes enough for them")
    x, weight = np.polynomial.legendre.leggauss(nodes)
    x, weight = x * bound, weight * bound

    def seen(start: np.ndarray) -> np.ndarray:
        z = (x[None, :] - a * start[:, None]) / spread
        return np.exp(-(z**2) / 2) * weight / (spread * math.sqrt(2 * math.pi))

    times = np.linalg.solve(np.eye(nodes) - seen(x), np.full(nodes, step))
    return float(step + (seen(np.zeros(1)) @ times)[0])
