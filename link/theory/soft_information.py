"""Information of decided bits: what a code with these soft values can carry at most.

The generalised mutual information of a bit x = +-1 with soft value L is

    I = max over s > 0 of 1 - E[log2(1 + exp(-s x L))]

(Martinez, Guillen i Fabregas, Caire, Willems, "Bit-interleaved coded modulation revisited: a
mismatched decoding perspective", IEEE Trans. IT 55:2756, 2009). A decoder that takes L, scaled by
one factor, for log likelihood ratios reaches it with long random codes. It is at most the
information of the spikes themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.error import CONFIDENCE
from link.theory.intervals import NORMAL, clopper_pearson

_FACTORS: Final = (1 / 64, 64.0)
"""Smallest and largest factor of the soft values that is tried."""
_STEPS: Final = 20
"""Steps of the golden section: the factor is then exact to a thousandth."""
_SEARCHED: Final = 100_000
"""Bits among which the factor is searched, about; the information is that of all."""
_FEW: Final = 10
"""Wrong values from which the normal approximation of the interval holds."""


@dataclass(frozen=True)
class SoftInformation:
    """Result of `soft_information`.

    Attributes:
        bits: information of a bit.
        low, high: 99.9 % interval, for independent bits or independent batches. With few wrong
            values, the lower end is at most the information of hard decisions with as many errors
            as the interval of Clopper and Pearson allows.
        factor: factor of the soft values at which it is reached.
    """

    bits: float
    low: float
    high: float
    factor: float


def _half_width(lost: npt.NDArray[np.float64], batch: npt.NDArray[np.intp] | None) -> float:
    """Half of the 99.9 % interval of the mean loss: normal for independent bits, Student's t over
    the batches' means otherwise (their sizes weigh as in a ratio estimate)."""
    if batch is None:
        return NORMAL * float(lost.std()) / float(np.sqrt(lost.size))
    from scipy.special import stdtrit

    sizes = np.bincount(batch)
    sums = np.bincount(batch, lost)[sizes > 0]
    sizes = sizes[sizes > 0]
    if sizes.size < 2:
        raise ValueError(f"batch must hold at least 2 batches, not {sizes.size}")
    apart = sums - float(lost.mean()) * sizes
    spread = np.sqrt(sizes.size / (sizes.size - 1) * (apart**2).sum()) / lost.size
    return float(stdtrit(sizes.size - 1, (1 + CONFIDENCE) / 2) * spread)


def soft_information(
    soft: npt.NDArray[np.floating],
    on: npt.NDArray[np.bool_],
    batch: npt.NDArray[np.intp] | None = None,
) -> SoftInformation | None:
    """Information of bits with these soft values; None without any.

    Args:
        soft: (n,) soft values, positive for on.
        on: (n,) bits that were sent.
        batch: (n,) number from 0 on of the batch of a bit, where bits of one batch may depend on
            each other (a region shares its pixels and their place); None if all are independent.

    Raises:
        ValueError: if there is one batch alone.
    """
    if soft.size == 0:
        return None
    right = np.where(on, soft, -soft).astype(np.float64)
    some = right[:: max(right.size // _SEARCHED, 1) | 1]  # odd: in all symbols of a transmission

    def lost(log_factor: float, of: npt.NDArray[np.float64] = some) -> npt.NDArray[np.float64]:
        return np.logaddexp(0.0, -np.exp(log_factor) * of) / np.log(2)

    # The mean is convex in the factor, so it has one minimum in the factor's logarithm.
    low, high = np.log(_FACTORS)
    golden = (np.sqrt(5) - 1) / 2
    inner, outer = high - golden * (high - low), low + golden * (high - low)
    at_inner, at_outer = lost(inner).mean(), lost(outer).mean()
    for _ in range(_STEPS):
        if at_inner <= at_outer:
            high, outer, at_outer = outer, inner, at_inner
            inner = high - golden * (high - low)
            at_inner = lost(inner).mean()
        else:
            low, inner, at_inner = inner, outer, at_outer
            outer = low + golden * (high - low)
            at_outer = lost(outer).mean()
    best = (low + high) / 2
    each = lost(best, right)
    bits, half = 1 - float(each.mean()), _half_width(each, batch)
    low_bits, high_bits = (float(np.clip(bits + part, 0, 1)) for part in (-half, half))
    wrong = int((right < 0).sum())
    if wrong < _FEW:
        most = float(clopper_pearson(wrong, right.size, CONFIDENCE)[1])
        low_bits = min(low_bits, 1 + most * np.log2(most) + (1 - most) * np.log2(1 - most))
    return SoftInformation(max(bits, 0.0), low_bits, high_bits, float(np.exp(best)))
