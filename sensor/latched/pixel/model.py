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

from cosim.compute.streams import Stream
from sensor.latched.pixel.fixed_point import LARGEST, ONE, Charge
from sensor.latched.pixel.interval import interval_table
from sensor.latched.pixel.span import Span
from sensor.latched.pixel.thresholds import first_thresholds, initial_deficit
from sensor.latched.pixel.transfer import Transfer

__all__ = ["DEEPEST", "JUMP", "ROOM", "ExactModel", "ExactPixels", "PixelState", "Reset"]

Reset = Literal["residual", "hard", "subtract"]
"""`residual`: charge beyond the threshold stays. `hard`: back to zero at the readout of a spike.
`subtract`: one threshold is taken off at most once a cycle, the rest piles up (to 2^21 e)."""
ROOM: Final = 4
"""Thresholds due at once from which whole ones are taken off without a draw each."""
JUMP: Final = 2
"""How many of them are left to be drawn one by one."""
DEEPEST: Final = -(1 << 61)
"""Least deficit under `subtract`: charge piles up to 2^21 electrons beyond a threshold."""


@dataclass(eq=False)
class PixelState:
    """deficit: threshold - charge - 1 in Q24.40, (n,) int64. spikes: index of the interval that is
    running, (n,) uint64."""

    deficit: Charge
    spikes: npt.NDArray[np.uint64]


class Drawing(Protocol):
    """An effect, as far as the model reads it: the stream of its draws."""

    @property
    def stream(self) -> Stream: ...


@dataclass(frozen=True)
class ExactModel:
    """The exact pixel's setting.

    Attributes:
        threshold: electrons, positive, below 2^21.
        seed: of the run, below 2^32.
        effects: of those that every pixel has, the ones that are kept.
        threshold_noise: standard deviation in electrons, drawn anew for each spike (kTC,
            comparator).
        reset: what becomes of the charge at a spike.
        dead_time: share of a cycle after each spike in which light is lost, in [0, 1].
        shift: electrons that every interval takes beyond its threshold, less than half of it
            either way: a comparator that answers late, a reset that leaves charge.
        transfers: maps of the charge that a cycle brings, in their order.
    """

    threshold: float
    seed: int
    effects: tuple[Drawing, ...]
    threshold_noise: float = 0.0
    reset: Reset = "residual"
    dead_time: float = 0.0
    shift: float = 0.0
    transfers: tuple[Transfer, ...] = ()

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
    def shot(self) -> bool:
        """Whether there is shot noise."""
        return any(effect.stream is Stream.SHOT_NOISE for effect in self.effects)

    @property
    def random_start(self) -> bool:
        """Whether the initial charge is random."""
        return any(effect.stream is Stream.INITIAL_CHARGE for effect in self.effects)

    @property
    def noisy(self) -> bool:
        """Whether each spike draws its threshold."""
        return self.shot or self.threshold_noise > 0

    def table(self) -> Charge:
        """Quantiles that thresholds are drawn from."""
        return self._shifted(interval_table(self.threshold, self.threshold_noise, self.shot))

    def _shifted(self, table: Charge) -> Charge:
        if not self.shift:
            return table
        shifted: Charge = np.maximum(table + round(self.shift * ONE), 1)
        shifted.setflags(write=False)
        return shifted

    def first_table(self) -> Charge:
        """Quantiles of the interval that a run starts in: longer ones are met more often. Weighted
        by its length Gamma(Q) is Gamma(Q + 1); the mean grows by variance / mean in any case."""
        longer = self.threshold + self.shot + self.threshold_noise**2 / self.threshold
        return self._shifted(interval_table(longer, self.threshold_noise, self.shot))

    def first_thresholds(self, pixels: npt.NDArray[np.uint32]) -> Charge:
        """Thresholds, Q24.40, of the intervals that a run starts in, (n,)."""
        if not self.noisy:
            return np.full(pixels.shape, self.q, np.int64)
        table = self.first_table() if self.random_start else self.table()
        return first_thresholds(table, pixels, self.seed)

    def initial(self, pixels: npt.NDArray[np.uint32]) -> PixelState:
        """State of the pixels with these numbers before the first cycle."""
        first = self.first_thresholds(pixels)
        if self.random_start:  # the charge is a share of the threshold itself
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
