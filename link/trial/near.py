"""How a bit error rate changes, by bits that are nearly wrong: an estimate from many where errors
are few.

A bit is nearly wrong where its soft value is for what was sent by less than a margin, the one that
a thousandth of the bits of full physics are within. So there are hundreds of them where one is
wrong, and two ways are compared by those that only one of the two has so, with the same chance in
every pixel. Estimated is that errors change by the same share as they do: what is left out moves
soft values, and the share by which that changes the bits below a margin goes with the slope of
ln(bits below it), which is much the same at no margin as at a small one. It grows somewhat towards
none: in the default link without glare and cross-talk, 13 % fewer bits are within a margin of 10,
14 % within 8, 6 % within 15.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.theory import clopper_pearson

__all__ = ["FEWEST", "SHARE", "WIDEST", "Lead", "Near", "near"]

SHARE: Final = 1e-3
"""Of the bits that are nearly wrong."""
FEWEST: Final = 200
"""Bits that are nearly wrong; the share is larger where there are few bits."""
WIDEST: Final = 0.01
"""Largest share. With fewer bits, errors alone are counted."""
_SPREAD: Final = 1.0
"""Each bit has a margin of its own within so much, the same in every way: some detectors' soft
values are a few numbers, and a margin among them would part what is alike."""
_SEED: Final = 0x6E656172
Lead = npt.NDArray[np.float32]
"""(symbols, cells)."""


@dataclass(frozen=True)
class Near:
    """bits: compared. count: that full physics has nearly wrong. more, fewer: those that only the
    other way, and only full physics has so. margin: of soft values, mean. relative: interval of the
    relative change of their number."""

    bits: int
    count: int
    more: int
    fewer: int
    margin: float
    relative: tuple[float, float]

    @property
    def change(self) -> float:
        """Relative, of their number."""
        return (self.more - self.fewer) / self.count

    @property
    def size(self) -> tuple[float, float]:
        """Interval of its size."""
        low, high = self.relative
        nearest = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
        return nearest, max(abs(low), abs(high))


def near(full: Lead, run: Lead, level: float) -> Near | None:
    """full, run: of each bit, by how much its soft value is for what was sent. level: of the
    interval. None where there are too few bits, or as many are wrong as would be nearly wrong."""
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
    each = 1 - (1 - level) / 2
    up, down = (clopper_pearson(n, bits, each) for n in (more, fewer))
    share = count / bits
    relative = float(up[0] - down[1]) / share, float(up[1] - down[0]) / share
    return Near(bits, count, more, fewer, margin, relative)
