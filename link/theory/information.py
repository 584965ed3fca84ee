"""Information rate of a pixel with carried charge, by forward recursion.

Arnold, Loeliger, Vontobel, Kavcic, Wang, "Simulation-based computation of information rates for
channels with memory", IEEE Trans. IT 52:3498 (2006): one long random sequence is sent, and I(X; Y)
= H(Y) - H(Y | X) follows from the normalisations of two recursions over the distribution of the
charge: one that knows the sent bits and one that does not. Here each step adds the entropy of its
predicted bit, for either input bit, instead of -log P(observed bit): the mean is the same and the
variance smaller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from link.theory.charge import Reset

Array = npt.NDArray[np.float64]
_RULES: Final[dict[Reset, int]] = {"hard": 0, "residual": 1, "subtract": 2}
_DEPTH: Final = 8
"""Number of thresholds of waiting charge with `subtract`; larger charges are clipped."""
_WARM: Final = 200
"""Ticks before the first that counts."""
_BATCHES: Final = 32


@dataclass(frozen=True)
class InformationRate:
    """Result of `fsc_information_rate`.

    Attributes:
        rate: bits per tick.
        low, high: 99 % limits by the method of batch means (Student's t).
        ticks: number of ticks simulated.
    """

    rate: float
    low: float
    high: float
    ticks: int


def _law(mean: float) -> tuple[int, Array]:
    """First count and the probabilities from it on of a Poisson variate.

    They cover 7 standard deviations; the remainder is below 1e-10.
    """
    from scipy.stats import poisson

    reach = 7 * math.sqrt(mean) + 12
    first = max(0, math.floor(mean - reach))
    law = poisson.pmf(np.arange(first, math.ceil(mean + reach) + 1), mean)
    return first, np.asarray(law / law.sum(), np.float64)


@njit(cache=True, nogil=True)
def _spread(belief, weight, first, law, q, rule, bit, out):  # type: ignore[no-untyped-def]
    """Adds to `out` the distribution of the charge after a tick in which `bit` was latched."""
    states = belief.size
    for v in range(states):
        mass = belief[v] * weight
        if mass < 1e-18:
            continue
        if bit == 0:
            last = min(q - v - first, law.size)
            for n in range(last):
                out[v + first + n] += mass * law[n]
            continue
        begin = max(q - v - first, 0)
        if rule == 0:
            for n in range(begin, law.size):
                out[0] += mass * law[n]
        elif rule == 1:
            to = (v + first + begin) % q
            for n in range(begin, law.size):
                out[to] += mass * law[n]
                to = to + 1 if to + 1 < q else 0
        else:
            for n in range(begin, law.size):
                out[min(v + first + n - q, states - 1)] += mass * law[n]


@njit(cache=True, nogil=True)
def _fires(belief, first, tail, q):  # type: ignore[no-untyped-def]
    """P(spike) in the next tick. tail[n]: P(count >= first + n)."""
    total = 0.0
    for v in range(belief.size):
        n = q - v - first
        total += belief[v] * (1.0 if n <= 0 else 0.0 if n >= tail.size else tail[n])
    return total


@njit(cache=True, nogil=True)
def _entropy(p):  # type: ignore[no-untyped-def]
    """Binary entropy, bits."""
    if p <= 0.0 or p >= 1.0:
        return 0.0
    return -(p * math.log2(p) + (1 - p) * math.log2(1 - p))


@njit(cache=True, nogil=True)
def _recursion(sent, counts, q, states, rule, p_on, f0, law0, t0, f1, law1, t1, gains):  # type: ignore[no-untyped-def]
    """Writes the information of each tick, bits, (ticks,), to `gains`.

    f0, law0, t0 and f1, law1, t1 are the first count, the distribution and its tail for OFF and ON.
    The arguments stay separate, because arrays of different lengths in a record would cost speed.
    """
    knowing, blind = np.zeros(states), np.zeros(states)
    knowing[0] = blind[0] = 1.0
    fresh = np.zeros(states)
    v = 0
    for k in range(sent.size):
        x = sent[k]
        of_blind = (1 - p_on) * _fires(blind, f0, t0, q) + p_on * _fires(blind, f1, t1, q)
        dark = _entropy(_fires(knowing, f0, t0, q))
        light = _entropy(_fires(knowing, f1, t1, q))
        gains[k] = _entropy(of_blind) - (1 - p_on) * dark - p_on * light
        v += counts[k]
        bit = 1 if v >= q else 0
        if bit:
            v = 0 if rule == 0 else v % q if rule == 1 else min(v - q, states - 1)
        fresh[:] = 0.0
        _spread(blind, 1 - p_on, f0, law0, q, rule, bit, fresh)
        _spread(blind, p_on, f1, law1, q, rule, bit, fresh)
        blind[:] = fresh / fresh.sum()
        fresh[:] = 0.0
        if x:
            _spread(knowing, 1.0, f1, law1, q, rule, bit, fresh)
        else:
            _spread(knowing, 1.0, f0, law0, q, rule, bit, fresh)
        knowing[:] = fresh / fresh.sum()


def fsc_information_rate(
    reset: Reset,
    q: int,
    mu_on: float,
    mu_off: float,
    *,
    ticks: int = 20_000,
    p_on: float = 0.5,
    seed: int = 1,
) -> InformationRate:
    """Information rate of independent random bits through one pixel, shot noise only.

    The rate of this input is a lower bound of the capacity.

    Args:
        reset: reset rule.
        q: threshold, electrons.
        mu_on, mu_off: mean electrons of a tick.
        ticks: number of ticks to simulate.
        p_on: share of ON bits.
        seed: seed of the random numbers.

    Raises:
        ValueError: if there are too few ticks for the batches.
    """
    from scipy.stats import t as student

    if q < 1 or mu_on < 0 or mu_off < 0 or not 0 < p_on < 1 or ticks < _BATCHES * 10:
        raise ValueError(
            f"q must be at least 1, the means at least 0, p_on between 0 and 1 and ticks at least "
            f"{_BATCHES * 10}, not {q}, {mu_on}, {mu_off}, {p_on}, {ticks}"
        )
    rng = np.random.Generator(np.random.Philox(key=[seed, 0x1F5C]))
    total = ticks + _WARM
    sent = (rng.random(total) < p_on).astype(np.uint8)
    (f0, law0), (f1, law1) = _law(mu_off), _law(mu_on)
    # Arrivals follow the truncated laws of the recursion, so none has probability 0 in it.
    draws = rng.random(total)
    counts = np.where(
        sent == 1,
        f1 + np.minimum(np.searchsorted(np.cumsum(law1), draws), law1.size - 1),
        f0 + np.minimum(np.searchsorted(np.cumsum(law0), draws), law0.size - 1),
    ).astype(np.int64)
    tails = [np.cumsum(law[::-1])[::-1].copy() for law in (law0, law1)]
    gains = np.zeros(total)
    states = q * _DEPTH if reset == "subtract" else q
    _recursion(
        sent, counts, q, states, _RULES[reset], p_on, f0, law0, tails[0], f1, law1, tails[1], gains
    )
    means = gains[_WARM : _WARM + ticks // _BATCHES * _BATCHES].reshape(_BATCHES, -1).mean(1)
    half = float(student.ppf(0.995, _BATCHES - 1) * means.std(ddof=1) / math.sqrt(_BATCHES))
    rate = float(means.mean())
    return InformationRate(rate, max(rate - half, 0.0), min(rate + half, 1.0), ticks)
