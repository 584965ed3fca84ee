"""What every form of the exact pixel shares: its setting, its state, the charge it is given.

Three forms compute the same bits from it: `plain` (numpy, the truth), `compiled` (numba) and
`kernel` (OpenCL).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal, Protocol

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Effect
from sensor.latched.effects import INITIAL_CHARGE, SHOT_NOISE, first_thresholds, initial_deficit
from sensor.latched.pixel.fixed_point import LARGEST, ONE, Charge
from sensor.latched.pixel.interval import interval_table

__all__ = ["DEEPEST", "JUMP", "ROOM", "ExactModel", "ExactPixels", "PixelState", "Reset", "Span"]

Reset = Literal["residual", "hard", "subtract"]
"""`residual`: charge beyond the threshold stays. `hard`: back to zero at the readout of a spike.
`subtract`: one threshold is taken off at most once a cycle, the rest piles up (to 2^21 e)."""
ROOM: Final = 4
"""Thresholds due at once from which whole ones are taken off without a draw each."""
JUMP: Final = 2
"""How many of them are left to be drawn one by one."""
DEEPEST: Final = -(1 << 61)
"""Least deficit under `subtract`: charge piles up to 2^21 electrons beyond a threshold."""


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
    threshold_noise: standard deviation in electrons, drawn anew for each spike (kTC, comparator).
    reset: what becomes of the charge at a spike. dead_time: share of a cycle after each spike in
    which light is lost, in [0, 1]. shift: electrons that every interval takes beyond its threshold,
    less than half of it either way: a comparator that answers late, a reset that leaves charge.
    """

    threshold: float
    seed: int
    effects: tuple[Effect, ...]
    threshold_noise: float = 0.0
    reset: Reset = "residual"
    dead_time: float = 0.0
    shift: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.threshold < LARGEST:
            raise ValueError(
                f"threshold must be above 0 and below {LARGEST} e, not {self.threshold:g} e"
            )
        most = min(self.threshold, LARGEST / 64)
        if not 0 <= self.threshold_noise <= most:
            raise ValueError(
                f"threshold noise must be 0 to {most:g} e, not {self.threshold_noise:g} e"
            )
        if not abs(self.shift) < self.threshold / 2:
            raise ValueError(
                f"shift must be within half a threshold, {self.threshold / 2:g} e, not "
                f"{self.shift:g} e"
            )
        if not 0 <= self.dead_time <= 1:
            raise ValueError(f"dead time must be 0 to 1 cycle, not {self.dead_time:g}")
        if not 0 <= self.seed < 2**32:
            raise ValueError(f"seed must be 0 to {2**32 - 1}, not {self.seed}")

    @property
    def mean(self) -> float:
        """Electrons of an interval, mean."""
        return self.threshold + self.shift

    @property
    def q(self) -> int:
        """That in Q24.40, at least one unit."""
        return max(round(self.mean * ONE), 1)

    @property
    def room(self) -> int:
        """ROOM thresholds, held at the largest int64."""
        return min(ROOM * self.q, 2**63 - 1)

    @property
    def dead(self) -> int:
        """Dead time in 2^-16 of a cycle."""
        return round(self.dead_time * 65536)

    @property
    def noisy(self) -> bool:
        """Whether each spike draws its threshold."""
        return SHOT_NOISE in self.effects or self.threshold_noise > 0

    def table(self) -> Charge:
        """Quantiles that thresholds are drawn from."""
        shot = SHOT_NOISE in self.effects
        return self._shifted(interval_table(self.threshold, self.threshold_noise, shot))

    def _shifted(self, table: Charge) -> Charge:
        if not self.shift:
            return table
        shifted: Charge = np.maximum(table + round(self.shift * ONE), 1)
        shifted.setflags(write=False)
        return shifted

    def _first_table(self) -> Charge:
        """Quantiles of the interval that a run starts in: longer ones are met more often. Weighted
        by its length Gamma(Q) is Gamma(Q + 1); the mean grows by variance / mean in any case."""
        shot = SHOT_NOISE in self.effects
        longer = self.threshold + shot + self.threshold_noise**2 / self.threshold
        return self._shifted(interval_table(longer, self.threshold_noise, shot))

    def first_thresholds(self, pixels: npt.NDArray[np.uint32]) -> Charge:
        """Thresholds, Q24.40, of the intervals that a run starts in, (n,)."""
        if not self.noisy:
            return np.full(pixels.shape, self.q, np.int64)
        table = self._first_table() if INITIAL_CHARGE in self.effects else self.table()
        return first_thresholds(table, pixels, self.seed)

    def initial(self, pixels: npt.NDArray[np.uint32]) -> PixelState:
        """State of the pixels with these numbers before the first cycle."""
        kept = INITIAL_CHARGE in self.effects
        first = self.first_thresholds(pixels)
        if kept:  # the charge is a share of the threshold itself
            beyond = round(self.shift * ONE)
            deficit = initial_deficit(np.maximum(first - beyond, 1), pixels, self.seed) + beyond
        else:
            deficit = first - 1
        return PixelState(deficit, np.zeros(pixels.shape, np.uint64))


class ExactPixels(Protocol):
    """A set of pixels that are exposed; the forms differ only in how fast."""

    def expose(self, spans: Iterable[Span], cycles: int) -> npt.NDArray[np.uint32]:
        """Runs `cycles` cycles, spans in order and without gaps; (ceil(cycles/32), n) words."""

    def state(self) -> PixelState:
        """The state now, as copies."""

    def restore(self, state: PixelState) -> None:
        """Go on from a state."""
