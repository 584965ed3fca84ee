"""Laws of widths, and of a code of them, in closed form.

A width X of steady light is Gamma(Q) with mean mu ticks (Huang 2022, section 5.1): relative
standard deviation (RSD) 1/sqrt(Q); threshold noise of s electrons adds (s/Q)^2 to its square. The
latch tells whole ticks: w = floor(U + X), where U, the phase of the spike before within its tick,
is uniform. The errors at both ends are uniform and independent once X spreads over a tick: they add
2/12 = 1/6 tick^2. Without noise the width takes the two whole values around mu = n + f, variance
f(1 - f): 1/6 on average over f, 1/4 at most.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.special import gammainc

LATCH_VARIANCE = 1 / 6
"""Variance that the latch adds to the variance of the interval, tick^2."""
_PHASES = 256
"""Midpoints of the phase integral."""
Law = npt.NDArray[np.float64]


def effective_q(q: float, noise: float = 0.0) -> float:
    """The Q whose shot noise alone has the RSD of threshold q with threshold noise, electrons."""
    return 1 / (1 / q + (noise / q) ** 2)


def _reach(mean: float, q: float) -> int:
    """Largest width of the computation, ticks; the probability beyond it is negligible.

    It is 12 standard deviations above the mean, plus an allowance for Gamma's heavier tail at small
    Q.
    """
    return math.ceil(mean * (1 + 12 / math.sqrt(q) + 80 / q)) + 2


def width_law(mean: float, q: float) -> Law:
    """P(w = n), n = 0, 1, ...: G(n+1) - 2 G(n) + G(n-1), G the integral of Gamma(q)'s
    distribution function, x F_q(x) - mean F_{q+1}(x).

    Beyond what the latch can say (w = 0, two spikes in a tick) this law does not hold: ValueError
    where that has a share above 1e-6.
    """
    x = np.arange(-1, _reach(mean, q) + 1, dtype=np.float64).clip(0)
    scaled = x * q / mean
    integral = x * gammainc(q, scaled) - mean * gammainc(q + 1, scaled)
    law = np.diff(integral, 2).clip(0)
    if law[0] > 1e-6:
        raise ValueError(f"a mean width of {mean:g} ticks at Q = {q:g} must saturate less")
    return law / law.sum()


def event_rate(mean: float, q: float, k: float, noise: float = 0.0) -> float:
    """Share of spikes that the statistical code sends of steady light: P(|w - w0| > k sigma(w0)),
    integrated over the law of the current width w0.

    Widths are taken as independent. w0 is a Markov chain: a width that differs enough takes its
    place. Were the bound the same for every w0, the chain would be reversible and w0's law that of
    any width. Since sigma grows with w0, the stationary law of the chain is solved for.
    """
    law = width_law(mean, effective_q(q, noise))
    keep = np.flatnonzero(law > 1e-15)
    n, p = keep.astype(np.float64), law[keep] / law[keep].sum()
    bound = k * np.sqrt(n**2 / effective_q(q, noise) + LATCH_VARIANCE)
    moves = np.abs(n[None, :] - n[:, None]) > bound[:, None]
    leave = moves @ p
    # Balance: what leaves w0 is what comes to it. With y = pi * leave: y = p * (moves^T pi).
    chain = moves * p[None, :]
    chain[np.diag_indices_from(chain)] += 1 - leave
    system = np.vstack([chain.T - np.eye(len(n)), np.ones(len(n))])
    wanted = np.append(np.zeros(len(n)), 1.0)
    stationary = np.linalg.lstsq(system, wanted, rcond=None)[0]
    return float(stationary @ leave)


def _entropy(p: Law) -> npt.NDArray[np.float64]:
    """Entropy over the last axis, bits."""
    return -np.sum(np.where(p > 0, p * np.log2(np.where(p > 0, p, 1)), 0), axis=-1)


def entropy_bounds(mean: float, q: float) -> tuple[float, float]:
    """Lower and upper bound of the entropy rate of latched widths in steady light, bits per spike.

    The lower bound is the entropy of a width if the phase of the previous spike is known, averaged
    over phases, because earlier widths contain at most the phase. The upper bound is the entropy of
    a single width. No lossless code of the stream is shorter on average than the lower bound. A
    code that uses only the distribution of a width reaches the upper bound.
    """
    n = np.arange(_reach(mean, q) + 2, dtype=np.float64)
    phase = ((np.arange(_PHASES) + 0.5) / _PHASES)[:, None]
    below = gammainc(q, (n[None, :] - phase).clip(0) * q / mean)
    conditional = np.diff(below, axis=1, append=1.0)
    return float(_entropy(conditional).mean()), float(_entropy(width_law(mean, q)))
