"""Measures on patches what noise from the bank changes, against a draw for each spike.

Two cameras that are equal otherwise film the patches, so their rates differ by two independent
noises. What can be measured are the mean of the difference, which is a change of the rate, and the
difference of their variances about a third camera, which has no noise: a change of the noise. Both
are averages over all patches and windows, with the intervals that follow from their scatter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]
_DOUBT: Final = 1e-6
"""Chance that an interval does not include the true change. A run beyond it is repeated without the
bank, which must not happen by chance."""


@dataclass(frozen=True)
class BankChange:
    """Changes by the bank, relative to the mean rate, with half widths of their intervals.

    Attributes:
        rate, rate_width: mean change of the rate.
        noise, noise_width: change of the standard deviation of a rate.
    """

    rate: float
    rate_width: float
    noise: float
    noise_width: float

    @property
    def value(self) -> float:
        """The larger change."""
        return max(abs(self.rate), abs(self.noise))

    @property
    def least(self) -> float:
        """The larger change, less its interval; 0 where the interval includes 0."""
        rate, noise = abs(self.rate) - self.rate_width, abs(self.noise) - self.noise_width
        return max(rate, noise, 0.0)


def bank_change(bank: Values, own: Values, noiseless: Values, floor: float) -> BankChange | None:
    """The change of rates by the bank, None with fewer than two patches.

    Windows may overlap, so the windows of a patch are one sample. Patches are independent.

    Args:
        bank, own, noiseless: (windows, patches, pixels) spikes a cycle, with noise from the bank,
            with a draw for each spike, and without noise.
        floor: spikes a cycle, least mean rate.
    """
    from scipy.special import stdtrit

    patches = bank.shape[1]
    if patches < 2:
        return None
    base = np.maximum(own.mean(axis=2, keepdims=True), max(floor, 1e-300))
    noise, reference = (bank - noiseless) / base, (own - noiseless) / base
    rates = (noise - reference).mean(axis=(0, 2))
    variance, other = (each.var(axis=2).mean(axis=0) for each in (noise, reference))
    both = (variance + other) / 2
    # Patches differ in their noise, so each contributes its relative change.
    sizes = math.sqrt(float(both.mean())) * (variance - other) / np.maximum(2 * both, 1e-300)
    score = -float(stdtrit(patches - 1, _DOUBT / 2)) / math.sqrt(patches)
    return BankChange(
        float(rates.mean()), score * float(rates.std(ddof=1)),
        float(sizes.mean()), score * float(sizes.std(ddof=1)),
    )  # fmt: skip
