"""A pixel of a link as a channel with memory (its charge): exact laws of its spikes.

Under random bits, each tick brings Poisson electrons of mean `mu_on` or `mu_off`. A latch reads
whether the threshold of q electrons was reached, and the reset rule sets the charge that remains.
Charges are whole electrons, so the channel has a finite number of states, and its stationary
distribution, which solves linear equations, gives the error rates. Shot noise only: no threshold
noise, no crosstalk, and light that changes at tick edges only.

Under given light that varies over a few ticks, hard reset has a closed form. Between resets charge
only grows. A pixel that was emptied before tick i has therefore not spiked by the end of tick j if
and only if the electrons of i to j are fewer than its threshold: a renewal process with independent
intervals (Cox, Renewal Theory, 1962). Under Poisson light of any course the smooth charge at which
a threshold of q electrons is reached is Gamma(q) distributed; threshold noise widens it. The
distribution is computed from the cube root, which is normal to within 1e-4 for q from 20 (Wilson
and Hilferty, PNAS 17:684, 1931).
"""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Reset = Literal["hard", "residual", "subtract"]
"""Charge after a spike. hard: zero. residual: the charge modulo q. subtract: the charge minus q, so
that one spike in a tick removes one threshold and the rest waits for the next tick."""
_DEPTH: Final = 10
"""Number of thresholds of waiting charge that `subtract` is modelled to. The truncated tail is 2e-4
of the distribution where a tick brings 1.5 or 0.1 thresholds, and p10 has the same relative error.
"""
_STATES: Final = 5000
"""Largest number of states that the equations are solved for: 200 MB."""


class PixelChannel(NamedTuple):
    """A pixel of a link as a channel.

    Attributes:
        reset: reset rule.
        q: threshold, electrons.
        mu_on, mu_off: mean electrons of a tick that shows ON or OFF.
        overlap: share of each tick that still shows the previous bit.
    """

    reset: Reset
    q: int
    mu_on: float
    mu_off: float
    overlap: float = 0.0


def charge_errors(channel: PixelChannel, p_on: float = 0.5) -> tuple[float, float]:
    """Stationary (p01, p10) under random bits: P(spike | off), P(no spike | on).

    Without overlap, `residual` keeps every charge equally likely (its steps are rotations), so p01
    = E[min(N, q)] / q; the equations agree with this. With `subtract` every threshold of charge is
    read in the end, so the mean number of spikes in a tick is the mean charge over q, which gives
    p01 from p10. If that mean is 1 or more, the charge grows without limit and every tick has a
    spike: (1, 0).

    Args:
        channel: the pixel; `overlap` must be 0 with `subtract`.
        p_on: share of ON bits.
    """
    reset, q, mu_on, mu_off, overlap = channel
    if not 0 <= overlap <= 1 or not 0 < p_on < 1:
        raise ValueError(f"overlap must be 0 to 1 and p_on between 0 and 1, not {overlap}, {p_on}")
    means, weights = (mu_off, mu_on), (1 - p_on, p_on)
    load = (p_on * mu_on + (1 - p_on) * mu_off) / q
    if reset == "subtract" and load >= 1:
        return 1.0, 0.0
    if overlap == 0:
        kernels = [charge_kernels(reset, q, m) for m in means]
        law = _stationary(weights[0] * kernels[0].sum(0) + weights[1] * kernels[1].sum(0))
        p01, p10 = float(law @ kernels[0][1].sum(1)), float(law @ kernels[1][0].sum(1))
        return (load - p_on * (1 - p10)) / (1 - p_on) if reset == "subtract" else p01, p10
    if reset == "subtract":
        raise ValueError("overlap must be 0 with subtract, whose states are too many")
    mixed = [
        [
            charge_kernels(reset, q, (1 - overlap) * means[now] + overlap * means[last])
            for now in (0, 1)
        ]
        for last in (0, 1)
    ]
    step = np.block([[weights[now] * mixed[last][now].sum(0) for now in (0, 1)] for last in (0, 1)])
    law = _stationary(step).reshape(2, q)
    wrong = [
        sum(float(law[last] @ mixed[last][now][1 - now].sum(1)) for last in (0, 1))
        for now in (0, 1)
    ]
    return wrong[0], wrong[1]


def charge_kernels(reset: Reset, q: int, mean: float, depth: int = _DEPTH) -> Array:
    """P(latched bit, charge after | charge before) of a tick, (2, states, states).

    Charges are 0 to q - 1; with `subtract` 0 to depth q - 1, where the last state holds all larger
    charges.
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


def _arrivals(mean: float, length: int) -> Array:
    """P(Poisson(mean) = 0 .. length - 1)."""
    from scipy.stats import poisson

    return np.asarray(poisson.pmf(np.arange(length), mean), np.float64)


def _stationary(step: Array) -> Array:
    """Stationary distribution of a stochastic matrix."""
    n = len(step)
    equations = step.T - np.eye(n)
    equations[-1] = 1.0
    law = np.linalg.solve(equations, np.eye(n)[-1])
    law = np.maximum(law, 0.0)
    return np.asarray(law / law.sum(), np.float64)


def longest_off_run(q: float, off: float, limit: float = 1e-6) -> int:
    """Longest run of OFF ticks whose probability of a false spike is below `limit`.

    The pixel is empty at the start and charge accumulates over the run.

    Args:
        q: threshold, electrons.
        off: mean electrons of an OFF tick.
        limit: probability.
    """
    from scipy.special import gammaincinv

    if off <= 0:
        raise ValueError(f"off must be above 0, not {off}: without background no run is too long")
    run = math.floor(float(gammaincinv(q, limit)) / off)
    while poisson_threshold(q, 0.0, (run + 1) * off)[0] < limit:
        run += 1
    while run and poisson_threshold(q, 0.0, run * off)[0] >= limit:
        run -= 1
    return run


def poisson_threshold(
    q: npt.ArrayLike, mean_on: npt.ArrayLike, mean_off: npt.ArrayLike
) -> tuple[Array, Array]:
    """(p01, p10) of a tick that starts with no charge: P(Poisson(off) >= q), P(Poisson(on) < q).

    The tails come from the incomplete gamma function, so probabilities far below 1e-16 are
    accurate; 1 - cdf would not be.

    Args:
        q: threshold, electrons, from 1.
        mean_on, mean_off: mean electrons of a tick.
    """
    from scipy.special import gammainc, gammaincc

    q, on, off = (np.asarray(a, np.float64) for a in (q, mean_on, mean_off))
    if (q < 1).any() or (on < 0).any() or (off < 0).any():
        raise ValueError("q must be at least 1 and both means at least 0")
    return np.asarray(gammainc(q, off)), np.asarray(gammaincc(q, on))


def hard_patterns(means: Array, window: int, q: float, noise: float = 0.0) -> Array:
    """P(pattern of the last `window` ticks), (..., 2^window).

    Bit j of a pattern is the spike of tick j of the window. The pixel is empty before the first
    tick.

    Args:
        means: (..., ticks) mean electrons of each tick over q electrons.
        window: number of ticks of the pattern.
        q, noise: probability and noise as in `survival`.
    """
    ticks = means.shape[-1]
    if not 1 <= window <= ticks:
        raise ValueError(f"window must be 1 to the {ticks} ticks given, not {window}")
    total = np.concatenate([np.zeros((*means.shape[:-1], 1)), np.cumsum(means, axis=-1)], axis=-1)
    first, last_one = np.triu_indices(ticks + 1, 1)
    gone = survival(total[..., last_one] - total[..., first], q, noise)
    alive = {
        pair: gone[..., n]
        for n, pair in enumerate(zip(first.tolist(), last_one.tolist(), strict=True))
    }
    one = np.ones(means.shape[:-1])
    alive |= {(i, i): one for i in range(ticks + 1)}  # an empty interval
    fresh = [one]  # P(reset just before a tick)
    for j in range(ticks - window):
        fresh.append(_fires(fresh, alive, j))
    out = np.zeros((*means.shape[:-1], 1 << window))
    start = ticks - window
    # (pattern, last, P(spikes of the pattern, the last one just before tick `last`))
    reached: list[tuple[int, int, Array]] = []
    out[..., 0] = sum(f * alive[i, ticks] for i, f in enumerate(fresh))
    for j in range(start, ticks):
        bit = 1 << (j - start)
        reached_now = [(bit, j + 1, _fires(fresh, alive, j))]
        reached_now += [
            (pattern | bit, j + 1, chance * (alive[last, j] - alive[last, j + 1]))
            for pattern, last, chance in reached
        ]
        reached += reached_now
    for pattern, last, chance in reached:
        out[..., pattern] = chance * alive[last, ticks]
    return out


def _fires(fresh: list[Array], alive: dict[tuple[int, int], Array], j: int) -> Array:
    """P(spike in tick j, and none since one of the `fresh` resets)."""
    return np.asarray(sum(f * (alive[i, j] - alive[i, j + 1]) for i, f in enumerate(fresh)))


def survival(charge: npt.ArrayLike, q: float, noise: float = 0.0) -> Array:
    """P(no spike yet) of a pixel that started empty.

    Args:
        charge: mean charge since then, in thresholds.
        q: threshold, electrons.
        noise: standard deviation of the threshold, electrons.
    """
    from scipy.special import ndtr

    shape = q * q / (q + noise * noise)
    level = np.cbrt(np.maximum(charge, 0.0)) - (1 - 1 / (9 * shape))
    return np.asarray(ndtr(-3 * np.sqrt(shape) * level), np.float64)
