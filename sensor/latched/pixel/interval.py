"""The distribution of an interval as a table: Gamma(Q) quantiles in fixed point.

Under Poisson light with any course in time, the smooth charge (the integral of the rate) at which a
pixel has collected Q electrons is Gamma(Q, 1) distributed, by time rescaling (Brown et al., Neural
Computation 14:325, 2002; Huang 2022 section 5.1 for constant light). Shot noise is therefore one
draw a spike: the table maps a uniform 32-bit word to the threshold that the smooth charge must
reach.

The knots are spaced like floating-point numbers. The word is folded to its distance y from the
nearer end of (0, 1), each octave of y has 128 knots, and the quantile is linear in y between knots.
Both tails are therefore resolved down to 2^-33, in integer arithmetic.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.cores import cores
from cosim.compute.stopping import threads
from cosim.compute.table_cache import cached_table
from sensor.latched.pixel.charge import ONE, Charge

MANTISSA_BITS: Final = 7
_M: Final = 1 << MANTISSA_BITS
KNOTS: Final = (31 - MANTISSA_BITS + 1) * _M + 1
"""Knots on each side of the median; the last is the median, y = 2^31."""
_NODES: Final = 321
"""Nodes of the trapezoid rule over +-8 standard deviations. For a smooth integrand its error falls
faster than any power of their number."""
_GRID: Final = 4001
"""Grid points on which the distribution is inverted."""
NO_TABLE: Charge = np.zeros(1, np.int64)
"""Array in place of a table where no lookup occurs. It is read-only like the tables; otherwise
numba would compile the loops a second time."""


def knot_places() -> npt.NDArray[np.int64]:
    """y of every knot: 0 to 127, then 128 an octave up to 2^31."""
    octave = np.arange(31 - MANTISSA_BITS, dtype=np.int64)[:, None]
    upper = (_M + np.arange(_M, dtype=np.int64)[None, :]) << octave
    return np.concatenate([np.arange(_M), upper.ravel(), [1 << 31]])


def _noisy_quantiles(q: float, sigma: float, shot: bool) -> npt.NDArray[np.float64]:
    """Quantiles of Gamma(q) + Normal(0, sigma) at the knots, from either end, in electrons.

    The distribution function is an integral over the density of the narrower variate. It is
    inverted on a grid of normal scores, in which it is nearly linear.
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.special import gammainc, gammaincinv, ndtr, ndtri

    p = (knot_places() + 0.5) / 2.0**32
    scores = np.concatenate([ndtri(p), -ndtri(p)])
    if not shot:
        return np.asarray(q + sigma * scores)
    z = np.linspace(-8, 8, _NODES)
    weights = np.exp(-z * z / 2)
    weights /= weights.sum()
    spread = 7 * np.hypot(np.sqrt(q), sigma) + 20
    x = np.linspace(max(q - spread, -7 * sigma), q + spread, _GRID)
    if sigma * sigma < q:
        # A quarter of a second on one core, while a run is planned and no other core is busy.
        with threads(cores()) as pool:
            parts = np.array_split(x, cores())
            below = pool.map(lambda x: gammainc(q, np.maximum(x[:, None] - sigma * z, 0)), parts)
            law = np.concatenate(list(below)) @ weights
    else:
        law = ndtr((x[:, None] - gammaincinv(q, ndtr(z))) / sigma) @ weights
    inside = (law > 1e-12) & (law < 1 - 1e-12)
    score = ndtri(law[inside])
    rising = np.flatnonzero(np.diff(score, prepend=-np.inf) > 0)
    return np.asarray(PchipInterpolator(score[rising], x[inside][rising])(scores))


@lru_cache(maxsize=32)
def interval_table(q: float, sigma: float = 0.0, shot: bool = True) -> Charge:
    """Quantiles of Gamma(q, 1) + Normal(0, sigma) in Q24.40.

    Knot y stands for the probability (y + 1/2) / 2^32 from its end. Every entry is at least one
    unit, which prevents an endless burst of spikes. A draw below 0, possible if the threshold noise
    is as large as Q, is raised to one unit and fires again at once.

    Args:
        q: threshold in electrons, above 0.
        sigma: threshold noise in electrons.
        shot: whether there is shot noise; without it the first variate is the constant q.

    Returns:
        (2 * KNOTS,) int64, read-only, lower side first.
    """
    if sigma > 0:
        given = (q, sigma, shot)
        electrons = cached_table("interval", given, (__file__,), lambda: _noisy_quantiles(*given))
    else:
        from scipy.special import gammainccinv, gammaincinv

        p = (knot_places() + 0.5) / 2.0**32
        # At Q = 2e6 the relative error of scipy's inverses is up to 5e-4 of a tail's probability
        # beyond 4.5 standard deviations, where its incomplete gamma function changes method;
        # elsewhere it is 1e-12.
        electrons = np.concatenate([gammaincinv(q, p), gammainccinv(q, p)])
    table: Charge = np.maximum(np.rint(electrons * ONE), 1).astype(np.int64)
    table.setflags(write=False)
    return table


NO_TABLE.setflags(write=False)


def threshold(table: Charge, word: npt.NDArray[np.uint32]) -> Charge:
    """Threshold in Q24.40 of each random word, (n,): the numpy form of the lookup."""
    word = np.asarray(word, np.uint32)
    upper = word >> np.uint32(31)
    y = np.where(upper == 1, ~word, word)
    exponent = np.maximum(np.frexp(y.astype(np.float64))[1].astype(np.int64) - 1 - MANTISSA_BITS, 0)
    y = y.astype(np.int64)
    mantissa = y >> exponent  # below 128 in the first octave, 128..255 in all others
    index = upper.astype(np.int64) * KNOTS + (exponent << MANTISSA_BITS) + mantissa
    fraction = ((y - (mantissa << exponent)) << 16) >> exponent
    low = table[index]
    # y is below 2^31, so every index has a next knot on its side. Below 128 the fraction is 0.
    step = table[np.minimum(index + 1, 2 * KNOTS - 1)] - low
    # The product of a step, up to 2^48 units, and a fraction of 16 bits would leave 64 bits. With
    # the step split at 16 bits the quotient is exact.
    return low + (step >> 16) * fraction + (((step & 0xFFFF) * fraction) >> 16)
