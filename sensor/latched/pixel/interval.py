"""The law of an interval as one table: Gamma(Q) quantiles in fixed point.

Under Poisson light of any course the smooth charge (the integral of the rate) at which a pixel
has gathered Q electrons is Gamma(Q, 1) distributed: time rescaling (Brown et al., Neural
Computation 14:325, 2002; Huang 2022 section 5.1 for constant light). So shot noise is one draw a
spike: a uniform 32-bit word looked up here gives the threshold that the smooth charge must reach.

The table is spaced as floating point is: the word is folded to its distance y from the nearer end
of (0, 1), each octave of y holds 128 knots, and between knots the quantile runs linearly in y.
Both tails are therefore resolved down to 2^-33, and everything is integer arithmetic.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.latched.pixel.fixed_point import ONE, Charge

__all__ = ["KNOTS", "MANTISSA_BITS", "NO_TABLE", "interval_table", "threshold"]

MANTISSA_BITS: Final = 7
_M: Final = 1 << MANTISSA_BITS
KNOTS: Final = (31 - MANTISSA_BITS + 1) * _M + 1
"""Knots on each side of the median; the last is the median itself, y = 2^31."""


def _knot_y() -> npt.NDArray[np.int64]:
    """y of every knot: 0..127 themselves, then 128 a octave up to 2^31."""
    octave = np.arange(31 - MANTISSA_BITS, dtype=np.int64)[:, None]
    upper = (_M + np.arange(_M, dtype=np.int64)[None, :]) << octave
    return np.concatenate([np.arange(_M), upper.ravel(), [1 << 31]])


_NODES: Final = 321
"""Nodes of the trapezoid rule over +-8 standard deviations, whose error for a smooth integrand
falls faster than any power of their number."""
_GRID: Final = 4001


def _noisy_quantiles(q: float, sigma: float, shot: bool) -> npt.NDArray[np.float64]:
    """Quantiles at the knots, from either end, of Gamma(q) + Normal(0, sigma), in electrons.

    The law is the integral of one over the other's density, the narrower of the two being
    integrated over; it is inverted on a grid of normal scores, where it is nearly straight.
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.special import gammainc, gammaincinv, ndtr, ndtri

    p = (_knot_y() + 0.5) / 2.0**32
    scores = np.concatenate([ndtri(p), -ndtri(p)])
    if not shot:
        return np.asarray(q + sigma * scores)
    z = np.linspace(-8, 8, _NODES)
    weights = np.exp(-z * z / 2)
    weights /= weights.sum()
    spread = 7 * np.hypot(np.sqrt(q), sigma) + 20
    x = np.linspace(max(q - spread, -7 * sigma), q + spread, _GRID)
    if sigma * sigma < q:
        law = gammainc(q, np.maximum(x[:, None] - sigma * z, 0)) @ weights
    else:
        law = ndtr((x[:, None] - gammaincinv(q, ndtr(z))) / sigma) @ weights
    inside = (law > 1e-12) & (law < 1 - 1e-12)
    score = ndtri(law[inside])
    rising = np.flatnonzero(np.diff(score, prepend=-np.inf) > 0)
    return np.asarray(PchipInterpolator(score[rising], x[inside][rising])(scores))


@lru_cache(maxsize=32)
def interval_table(q: float, sigma: float = 0.0, shot: bool = True) -> Charge:
    """Quantiles of Gamma(q, 1), with Normal(0, sigma) added, in Q24.40: (2 * KNOTS,) int64, lower
    side first.

    q: threshold in electrons, > 0. sigma: threshold noise in electrons. shot: whether there is shot
    noise at all. Knot y stands for probability (y + 1/2) / 2^32 from its end. Every entry is at
    least one unit, so no draw can make a pixel fire for ever; a draw below zero, which threshold
    noise of the size of Q can make, fires again at once.
    """
    from scipy.special import gammainccinv, gammaincinv

    if sigma > 0:
        electrons = _noisy_quantiles(q, sigma, shot)
    else:
        p = (_knot_y() + 0.5) / 2.0**32
        # At Q = 2e6 scipy's inverses are off by up to 5e-4 of a tail's probability, and only beyond
        # 4.5 standard deviations, where its incomplete gamma function changes method; elsewhere by
        # 1e-12.
        electrons = np.concatenate([gammaincinv(q, p), gammainccinv(q, p)])
    table: Charge = np.maximum(np.rint(electrons * ONE), 1).astype(np.int64)
    step = np.abs(np.diff(table.reshape(2, KNOTS)[:, 2 * _M :])).max()
    if step >= 1 << 46:  # the product with a 16-bit fraction must stay below 2^62
        raise ValueError(f"threshold must leave table steps below 2^46, not {step} at Q = {q:g}")
    table.setflags(write=False)
    return table


NO_TABLE: Charge = np.zeros(1, np.int64)
"""Stands for a table where none is looked up: read-only as they are, or numba would compile what is
given it once more."""
NO_TABLE.setflags(write=False)


def threshold(table: Charge, word: npt.NDArray[np.uint32]) -> Charge:
    """Threshold in Q24.40 for each random word: the numpy form of the lookup."""
    word = np.asarray(word, np.uint32)
    upper = word >> np.uint32(31)
    y = np.where(upper == 1, ~word, word)
    exponent = np.maximum(np.frexp(y.astype(np.float64))[1].astype(np.int64) - 1 - MANTISSA_BITS, 0)
    y = y.astype(np.int64)
    mantissa = y >> exponent  # below 128 in the first octave, 128..255 in all others
    index = upper.astype(np.int64) * KNOTS + (exponent << MANTISSA_BITS) + mantissa
    fraction = ((y - (mantissa << exponent)) << 16) >> exponent
    low = table[index]
    # y = 127 and the median side's last knot have a neighbour to run to; the fraction of the
    # entries below 128 is 0, so theirs does not matter.
    high = table[np.minimum(index + 1, 2 * KNOTS - 1)]
    return low + (((high - low) * fraction) >> 16)
