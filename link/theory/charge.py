"""A pixel of a link as a channel with a memory, its charge: exact error rates under random bits.

Each tick brings Poisson electrons, of mean `mu_on` or `mu_off`; a latch says whether the threshold
of q electrons was reached, and the reset rule what is left. Charges are whole electrons, so the
channel has finitely many states and its stationary law is the solution of linear equations. Shot
noise alone: no threshold noise, no crosstalk, and light that changes at ticks' edges only.
"""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

__all__ = [
    "Reset", "charge_errors", "charge_kernels", "longest_off_run", "poisson_threshold",
]  # fmt: skip

Reset = Literal["hard", "residual", "subtract"]
"""What is left after a spike: nothing; the charge modulo q; the charge less one q, so that a tick's
single spike takes off one threshold and the rest waits for the next tick."""
Array = npt.NDArray[np.float64]
_DEPTH: Final = 10
"""Thresholds of waiting charge that `subtract` is followed to. What is cut off is 2e-4 of the law
where a tick brings 1.5 or .1 thresholds, and p10 is off by as much of itself."""
_STATES: Final = 5000
"""Most states that equations are solved for: 200 MB."""


def poisson_threshold(
    q: npt.ArrayLike, mean_on: npt.ArrayLike, mean_off: npt.ArrayLike
) -> tuple[Array, Array]:
    """(p01, p10) of one tick that begins with no charge: P(Poisson(off) >= q), P(Poisson(on) < q).

    q: electrons, from 1. The tails are the incomplete gamma function's own, so that one far below
    1e-16 keeps its digits, which 1 - cdf does not.
    """
    from scipy.special import gammainc, gammaincc

    q, on, off = (np.asarray(a, np.float64) for a in (q, mean_on, mean_off))
    if (q < 1).any() or (on < 0).any() or (off < 0).any():
        raise ValueError("q must be at least 1 and both means at least 0")
    return np.asarray(gammainc(q, off)), np.asarray(gammaincc(q, on))


def _arrivals(mean: float, length: int) -> Array:
    """P(Poisson(mean) = 0 .. length - 1)."""
    from scipy.stats import poisson

    return np.asarray(poisson.pmf(np.arange(length), mean), np.float64)


def charge_kernels(reset: Reset, q: int, mean: float, depth: int = _DEPTH) -> Array:
    """P(latched bit, charge after | charge before) of a tick of this mean, (2, states, states).

    Charges are 0 to q - 1, with `subtract` to depth q - 1, where the last holds all beyond.
    """
    states = q * depth if reset == "subtract" else q
    if q < 1 or mean < 0 or states > _STATES:
        raise ValueError(f"q must be 1 to {_STATES} states and mean at least 0, not {q}, {mean}")
    # What can arrive and end below the last threshold that matters; the rest by complement.
    span = states + q
    law = _arrivals(mean, max(span, math.ceil(mean + 12 * math.sqrt(mean) + 30)))
    kernel = np.zeros((2, states, states))
    for v in range(states):
        lacking = max(q - v, 0)
        dark, fired = law[:lacking], law[lacking:]
        kernel[0, v, v : v + dark.size] = dark
        total = v + lacking + np.arange(fired.size)
        if reset == "hard":
            kernel[1, v, 0] = fired.sum()
        elif reset == "residual":
            kernel[1, v] = np.bincount(total % q, fired, q)
        else:
            kernel[1, v] = np.bincount(np.minimum(total - q, states - 1), fired, states)
    return kernel / kernel.sum((0, 2))[None, :, None]


def _stationary(step: Array) -> Array:
    """The law that a stochastic matrix keeps."""
    n = len(step)
    equations = step.T - np.eye(n)
    equations[-1] = 1.0
    law = np.linalg.solve(equations, np.eye(n)[-1])
    law = np.maximum(law, 0.0)
    return np.asarray(law / law.sum(), np.float64)


def charge_errors(
    reset: Reset, q: int, mu_on: float, mu_off: float, late: float = 0.0, p_on: float = 0.5
) -> tuple[float, float]:
    """(p01, p10) of a slicer on random bits in the long run: P(spike | off), P(no spike | on).

    late: share of each tick that still shows the bit before, of a row that samples so late. p_on:
    share of ON bits. Without `late`, `residual` keeps every charge equally likely (its steps are
    rotations), so p01 = E[min(N, q)] / q; the equations give the same and are tested against it.
    With `subtract` every threshold's worth of charge is read in the end, so a tick's spikes are its
    mean charge over q, which gives p01 from p10; where that mean is 1 or more the charge grows
    without end and every tick has its spike: (1, 0).
    """
    if not 0 <= late <= 1 or not 0 < p_on < 1:
        raise ValueError(f"late must be 0 to 1 and p_on between 0 and 1, not {late}, {p_on}")
    means, weights = (mu_off, mu_on), (1 - p_on, p_on)
    load = (p_on * mu_on + (1 - p_on) * mu_off) / q
    if reset == "subtract" and load >= 1:
        return 1.0, 0.0
    if late == 0:
        kernels = [charge_kernels(reset, q, m) for m in means]
        law = _stationary(weights[0] * kernels[0].sum(0) + weights[1] * kernels[1].sum(0))
        p01, p10 = float(law @ kernels[0][1].sum(1)), float(law @ kernels[1][0].sum(1))
        return (load - p_on * (1 - p10)) / (1 - p_on) if reset == "subtract" else p01, p10
    if reset == "subtract":
        raise ValueError("late must be 0 with subtract, whose states are too many")
    mixed = [
        [charge_kernels(reset, q, (1 - late) * means[now] + late * means[last]) for now in (0, 1)]
        for last in (0, 1)
    ]
    step = np.block([[weights[now] * mixed[last][now].sum(0) for now in (0, 1)] for last in (0, 1)])
    law = _stationary(step).reshape(2, q)
    wrong = [
        sum(float(law[last] @ mixed[last][now][1 - now].sum(1)) for last in (0, 1))
        for now in (0, 1)
    ]
    return wrong[0], wrong[1]


def longest_off_run(q: float, off: float, limit: float = 1e-6) -> int:
    """Longest run of OFF ticks, each bringing a mean of `off` electrons to an empty pixel, in which
    a false spike has a probability below `limit`. Charge adds up over the run."""
    from scipy.special import gammaincinv

    if off <= 0:
        raise ValueError(f"off must be above 0, not {off}: without background no run is too long")
    run = math.floor(float(gammaincinv(q, limit)) / off)
    while poisson_threshold(q, 0.0, (run + 1) * off)[0] < limit:
        run += 1
    while run and poisson_threshold(q, 0.0, run * off)[0] >= limit:
        run -= 1
    return run
