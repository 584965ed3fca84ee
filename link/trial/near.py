"""Change of a bit error rate, estimated from bits that are nearly wrong, where errors are rare.

A bit is nearly wrong if its soft value favours the sent bit by less than a margin. The margin is
chosen so that a thousandth of the bits of full physics are within it, which gives hundreds of such
bits for each error. Two simulations with the same random numbers are compared by the bits that are
nearly wrong in only one of them. The estimate assumes that errors change by the same share: an
omitted effect shifts soft values, and the share by which that changes the number of bits below a
margin follows the slope of ln(number), which is similar at zero and at a small margin. It grows
slightly towards zero: in the default link without glare and cross-talk, 13 % fewer bits are within
a margin of 10, 14 % within 8, 6 % within 15.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.error import CONFIDENCE
from link.theory import clopper_pearson

SHARE: Final = 1e-3
"""Share of the bits that are nearly wrong."""
FEWEST: Final = 200
"""Smallest number of nearly wrong bits; with few bits the share is larger."""
WIDEST: Final = 0.01
"""Largest share. With fewer bits, only errors are counted."""
_SPREAD: Final = 1.0
"""Range of the random offset of each bit's margin, the same in all simulations: some detectors have
few distinct soft values, and a single margin could split equal ones."""
_SEED: Final = 0x6E656172
Lead = npt.NDArray[np.float32]
"""(symbols, cells) soft value in favour of the sent bit."""


@dataclass(frozen=True)
class Near:
    """Comparison of nearly wrong bits.

    Attributes:
        bits: number of bits compared.
        count: bits that are nearly wrong with full physics.
        more, fewer: bits that are nearly wrong only in the other simulation, and only with full
            physics.
        margin: mean margin of soft values.
        relative: interval of the relative change of their number.
    """

    bits: int
    count: int
    more: int
    fewer: int
    margin: float
    relative: tuple[float, float]

    @property
    def change(self) -> float:
        """Relative change of their number."""
        return (self.more - self.fewer) / self.count

    @property
    def size(self) -> tuple[float, float]:
        """Interval of the magnitude of the relative change."""
        low, high = self.relative
        nearest = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
        return nearest, max(abs(low), abs(high))


def near(full: Lead, run: Lead) -> Near | None:
    """Compares nearly wrong bits; None if there are too few bits or too many errors.

    Args:
        full, run: soft values in favour of the sent bits.
    """
    bits = full.size
    count = max(round(SHARE * bits), FEWEST)
    if count > WIDEST * bits:
        return None
    offset = np.random.default_rng(_SEED).uniform(-_SPREAD, _SPREAD, full.shape).astype(np.float32)
    one, two = full - offset, run - offset
    margin = float(np.partition(one.ravel(), count)[count])
    if margin <= _SPREAD:
        return None
    first, second = one < margin, two < margin
    count = int(first.sum())
    if not count:
        return None
    more, fewer = int((second & ~first).sum()), int((first & ~second).sum())
    each = 1 - (1 - CONFIDENCE) / 2
    up, down = (clopper_pearson(n, bits, each) for n in (more, fewer))
    share = count / bits
    relative = float(up[0] - down[1]) / share, float(up[1] - down[0]) / share
    return Near(bits, count, more, fewer, margin, relative)
