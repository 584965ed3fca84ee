"""What every form of the exact pixel shares: its setting, its state, the charge it is given.

Three forms compute the same bits from it: `plain` (numpy, the truth), `compiled` (numba) and
`kernel` (OpenCL).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim.effects import Effect
from sensor.effects import INITIAL_CHARGE, SHOT_NOISE, first_thresholds, initial_deficit
from sensor.pixel.fixed_point import LARGEST, ONE, Charge
from sensor.pixel.interval import interval_table

__all__ = ["JUMP", "ROOM", "ExactModel", "ExactPixels", "PixelState", "Span"]

ROOM: Final = 4
"""Thresholds due at once from which whole ones are taken off without a draw each."""
JUMP: Final = 2
"""How many of them are left to be drawn one by one."""


@dataclass(frozen=True, eq=False)
class Span:
    """Charge that falls in cycles `first` to `first + cycles` of a block's words.

    charge: Q24.40 of the cycle where this course of light began, (n,) int64 >= 0. slope: its
    change a cycle, or None. elapsed: cycles between that one and `first`, so that the same arrays
    serve every block and every split of the run.
    """

    first: int
    cycles: int
    charge: Charge
    slope: Charge | None = None
    elapsed: int = 0


@dataclass(eq=False)
class PixelState:
    """deficit: threshold - charge - 1 in Q24.40, (n,) int64. spikes: index of the interval that is
    running, (n,) uint64."""

    deficit: Charge
    spikes: npt.NDArray[np.uint64]


@dataclass(frozen=True)
class ExactModel:
    """The exact pixel's setting.

    threshold: electrons, positive, below 2^21. seed: of the run, below 2^32. effects: those kept.
    """

    threshold: float
    seed: int
    effects: tuple[Effect, ...]

    def __post_init__(self) -> None:
        if not 0 < self.threshold < LARGEST:
            raise ValueError(
                f"threshold must be above 0 and below {LARGEST} e, not {self.threshold:g} e"
            )
        if not 0 <= self.seed < 2**32:
            raise ValueError(f"seed must be 0 to {2**32 - 1}, not {self.seed}")

    @property
    def q(self) -> int:
        """Threshold in Q24.40, at least one unit."""
        return max(round(self.threshold * ONE), 1)

    @property
    def room(self) -> int:
        """ROOM thresholds, held at the largest int64."""
        return min(ROOM * self.q, 2**63 - 1)

    @property
    def noisy(self) -> bool:
        return SHOT_NOISE in self.effects

    def table(self) -> Charge:
        """Quantiles that thresholds are drawn from."""
        return interval_table(self.threshold)

    def initial(self, pixels: npt.NDArray[np.uint32]) -> PixelState:
        """State of the pixels with these numbers before the first cycle."""
        first = np.full(pixels.shape, self.q, np.int64)
        if self.noisy:
            first = first_thresholds(self.table(), pixels, self.seed)
        kept = INITIAL_CHARGE in self.effects
        deficit = initial_deficit(first, pixels, self.seed) if kept else first - 1
        return PixelState(deficit, np.zeros(pixels.shape, np.uint64))


class ExactPixels(Protocol):
    """A set of pixels that are exposed; the forms differ only in how fast."""

    def expose(self, spans: Sequence[Span], cycles: int) -> npt.NDArray[np.uint32]:
        """Runs `cycles` cycles, spans in order and without gaps; (ceil(cycles/32), n) words."""

    def state(self) -> PixelState:
        """The state now, as copies."""

    def restore(self, state: PixelState) -> None:
        """Go on from a state."""
