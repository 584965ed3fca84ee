"""Electron multiplication: a packet of electrons passes S stages, in each of which every electron
makes one more with a small probability p.

Mean gain g = (1 + p)^S, so p = g^(1/S) - 1. The variance of one electron's output follows from the
branching recursion (Galton-Watson): g^2 v with v = (1 - 1/g)(1 - p)/(1 + p), so that Poisson
electrons come out with F^2 = 1 + v times the noise power of a gain without noise (Robbins and
Hadwen, IEEE Trans. Electron Devices 50:1227, 2003, in their notation).

Exact tier: `branch`, a binomial draw a stage. Fast tier: `multiply`, one draw of m + NegBin(k m, (g
- 1)/k): with k = 1 this is the distribution for infinitely many stages (a Yule process), and k = (g
- 1)/(g (1 - p)/(1 + p) - 1) gives exactly the variance of S stages. Moments from the third on are
not exact (`laws.py` measures the distance).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.draws import negative_binomial, uniforms
from cosim.compute.streams import Stream
from imagers.emccd.pixels.chip import STAGES

__all__ = ["branch", "excess_noise_squared", "fast_shape", "multiply", "stage_probability"]

Values = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

_ATTEMPTS: Final = 64
"""Counters reserved for a stage; a rejection needs more with probability below 1e-40."""


def stage_probability(gain: float, stages: int = STAGES) -> float:
    """p of one stage: g^(1/S) - 1. 1 <= gain <= 2^stages."""
    if not stages >= 1 or not gain >= 1 or math.log2(gain) > stages:
        raise ValueError(f"gain must be 1 to 2^stages, not {gain:g} in {stages} stages")
    return math.expm1(math.log(gain) / stages)


def excess_noise_squared(gain: float, stages: int = STAGES) -> float:
    """F^2 = 1 + (1 - 1/g)(1 - p)/(1 + p): 1 at gain 1, 1.901 at g = S = 100, 2 at the most."""
    p = stage_probability(gain, stages)
    return 1.0 + (1.0 - 1.0 / gain) * (1.0 - p) / (1.0 + p)


def fast_shape(gain: float, stages: int = STAGES) -> float:
    """k of the fast law, a little over 1 for many stages.

    Raises ValueError if the output of one electron has less variance than a Poisson count (gain of
    few stages): no negative binomial is so narrow, and the exact tier is needed.
    """
    p = stage_probability(gain, stages)
    if gain == 1.0:
        return 1.0
    over = gain * (1.0 - p) / (1.0 + p) - 1.0
    if not over > 0:
        raise ValueError(
            f"gain {gain:g} of {stages} stages must be drawn stage by stage, not by the fast law"
        )
    return (gain - 1.0) / over


@njit(cache=True, nogil=True)
def _binomial_one(count, p, pixel, frame, draw, seed, stream):  # type: ignore[no-untyped-def]
    """Binomial count, 0 < p <= 1/2: inversion where few are expected, else transformed rejection
    BTRS (Hoermann, J. Stat. Comput. Simul. 46:101, 1993)."""
    q = 1.0 - p
    if count * p < 10.0:
        u, _ = uniforms(pixel, frame, draw, seed, stream)
        odds = p / q
        term = math.exp(count * math.log1p(-p))
        total, k = term, 0
        while u > total and k < count:
            term *= odds * (count - k) / (k + 1.0)
            k += 1
            total += term
        return k
    spread = math.sqrt(count * p * q)
    b = 1.15 + 2.53 * spread
    a = -0.0873 + 0.0248 * b + 0.01 * p
    bound = 0.92 - 4.2 / b
    while True:
        u, v = uniforms(pixel, frame, draw, seed, stream)
        draw += 1
        u -= 0.5
        edge = 0.5 - abs(u)
        k = math.floor((2.0 * a / edge + b) * u + count * p + 0.5)
        if edge >= 0.07 and v <= bound:
            return int(k)
        if k < 0 or k > count:
            continue
        middle = math.floor((count + 1.0) * p)
        weight = (2.83 + 5.1 / b) * spread * v / (a / (edge * edge) + b)
        law = math.lgamma(middle + 1.0) + math.lgamma(count - middle + 1.0)
        law -= math.lgamma(k + 1.0) + math.lgamma(count - k + 1.0)
        if math.log(weight) <= law + (k - middle) * math.log(p / q):
            return int(k)


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def _branch(electrons, p, stages, numbers, frame, seed, stream, out):  # type: ignore[no-untyped-def]
    flip = p > 0.5
    share = 1.0 - p if flip else p
    for n in range(electrons.size):
        held = electrons[n]
        if held > 0 and p > 0.0:
            for stage in range(stages):
                more = 0
                if share > 0.0:
                    draw = stage * _ATTEMPTS
                    more = _binomial_one(held, share, numbers[n], frame, draw, seed, stream)
                held += held - more if flip else more
        out[n] = held


def branch(
    electrons: npt.ArrayLike, gain: float, numbers: Numbers, frame: int, seed: int,
    stages: int = STAGES, stream: Stream = Stream.IMAGER_GAIN,
) -> npt.NDArray[np.int64]:  # fmt: skip
    """Exact tier: electrons after all stages, each stage a binomial draw. About 40 us a pixel.

    electrons: integers, of the shape of `numbers` or one for all. Draws have the key (seed, stream)
    and the counter (number, frame, stage).
    """
    p = stage_probability(gain, stages)
    held = np.broadcast_to(np.asarray(electrons, np.int64), numbers.shape)
    flat = np.ascontiguousarray(numbers, np.int64).reshape(-1)
    out = np.empty(numbers.size, np.int64)
    held = np.ascontiguousarray(held).reshape(-1)
    _branch(held, p, stages, flat, frame, seed, int(stream), out)
    return out.reshape(numbers.shape)


def multiply(
    electrons: npt.ArrayLike, gain: float, numbers: Numbers, frame: int, seed: int,
    stages: int = STAGES, stream: Stream = Stream.IMAGER_GAIN,
) -> Values:  # fmt: skip
    """Fast tier: one draw of m + NegBin(k m, (g - 1)/k), exact in mean and variance.

    electrons: as for `branch`; fractions are allowed (light without shot noise).
    """
    held = np.broadcast_to(np.asarray(electrons, np.float64), numbers.shape)
    if gain == 1.0:
        return held.copy()
    k = fast_shape(gain, stages)
    made = negative_binomial(k * held, (gain - 1.0) / k, numbers, frame, seed, stream)
    return held + made
