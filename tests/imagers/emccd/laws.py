"""Laws of a multiplication register's output, in closed form, and how far each is from the truth.

Truth (`exact_law`): the generating function of one stage is f(z) = z (1 - p + p z), that of S
stages f(f(...f(z))), and of m electrons its m-th power; its values on the unit circle, transformed
back, are the probabilities, exact but for rounding (1e-12).

`fast_law`: m + NegBin(k m, (g - 1)/k), what `multiply` draws: mean and variance of the truth.
`yule_law`: k = 1, infinitely many stages; its F^2 = 2 - 1/g is 1.3 % too large at g = 1000 of 536
stages. `tubbs_law` and `basden_law`: Tubbs, PhD thesis, Cambridge 2003; Basden, Haniff and Mackay,
MNRAS 345:985 (2003): without a gain of 1 as its limit, from about gain 200.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from imagers.emccd.pixels.chip import STAGES
from imagers.emccd.pixels.multiplication import fast_shape, stage_probability

Values = npt.NDArray[np.float64]


def exact_law(electrons: int, gain: float, stages: int = STAGES, size: int | None = None) -> Values:
    """P(n), n = 0 .. size - 1, of m electrons after S stages. size: a power of two that holds the
    tail (an m-th of 1e-15 is aliased); chosen when None."""
    size = size or law_size(electrons, gain)
    p = stage_probability(gain, stages)
    z = np.exp(-2j * np.pi * np.arange(size // 2 + 1) / size)
    for _ in range(stages):
        z = z * (1.0 - p + p * z)
    return np.fft.irfft(z**electrons, size)


def law_size(electrons: int, gain: float) -> int:
    """Power of two past which no law has 1e-15."""
    mean = electrons * gain
    reach = mean + 12.0 * math.sqrt(electrons) * gain + 36.0 * gain + 64.0
    return 1 << math.ceil(math.log2(reach))


def _negative_binomial(electrons: int, gain: float, k: float, size: int) -> Values:
    from scipy.stats import nbinom

    more = np.arange(size) - electrons
    law: Values = nbinom.pmf(more, k * electrons, 1.0 / (1.0 + (gain - 1.0) / k))
    return law


def fast_law(electrons: int, gain: float, stages: int = STAGES, size: int | None = None) -> Values:
    """P(n) of what `multiply` draws."""
    size = size or law_size(electrons, gain)
    return _negative_binomial(electrons, gain, fast_shape(gain, stages), size)


def yule_law(electrons: int, gain: float, stages: int = STAGES, size: int | None = None) -> Values:
    """P(n) of infinitely many stages: n - m ~ NegBin(m, 1/g). stages: not read."""
    return _negative_binomial(electrons, gain, 1.0, size or law_size(electrons, gain))


def tubbs_law(electrons: int, gain: float, stages: int = STAGES, size: int | None = None) -> Values:
    """P(n) = (n-m+1)^(m-1) / ((m-1)! (g-1+1/m)^m) exp(-(n-m+1)/(g-1+1/m)), n >= m."""
    m = electrons
    more = np.arange(size or law_size(m, gain)) - m + 1.0
    scale = gain - 1.0 + 1.0 / m
    power = (m - 1) * np.log(np.maximum(more, 0.5)) - math.lgamma(m) - m * math.log(scale)
    return np.where(more > 0, np.exp(power - more / scale), 0.0)


def basden_law(
    electrons: int, gain: float, stages: int = STAGES, size: int | None = None
) -> Values:
    """P(n) = n^(m-1) exp(-n/g) / (g^m Gamma(m)): a gamma density taken at whole n."""
    m = electrons
    n = np.arange(size or law_size(m, gain), dtype=np.float64)
    power = (m - 1) * np.log(np.maximum(n, 0.5)) - math.lgamma(m) - m * math.log(gain)
    return np.where(n > 0, np.exp(power - n / gain), 0.0)


Law = Callable[..., Values]

LAWS: dict[str, Law] = {
    "fast": fast_law,
    "yule": yule_law,
    "tubbs": tubbs_law,
    "basden": basden_law,
}
"""What can stand for the truth."""


def law_distance(law: Law, electrons: int, gain: float, stages: int = STAGES) -> float:
    """Total variation between a law and the truth: the most by which any event's probability
    differs, 0 to 1 (a law that does not sum to 1 has its lack in it)."""
    exact = exact_law(electrons, gain, stages)
    other = law(electrons, gain, stages, exact.size)
    return float(np.abs(exact - other).sum() / 2.0)
