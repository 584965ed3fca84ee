"""Model and state of the exact pixel, which all its forms share.

Three forms compute the same bits: `numpy_form` (the golden model), `compiled` (numba) and `kernel`
(OpenCL).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal, Protocol

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from sensor.latched.pixel.charge import LARGEST, ONE, Charge, Span, Transfer
from sensor.latched.pixel.interval import NO_TABLE, interval_table
from sensor.latched.pixel.thresholds import first_thresholds, initial_deficit

Reset = Literal["residual", "hard", "subtract"]
"""Reset rule. `residual`: charge beyond the threshold stays. `hard`: charge returns to 0 at the
readout of a spike. `subtract`: at most one threshold is subtracted a cycle, and the rest
accumulates up to 2^21 electrons."""
_LARGE: Final = 1 << 12
"""Number of pixels from which the compiled form of the first draws is taken."""
ROOM: Final = 4
"""Excess charge, in thresholds, above which whole thresholds are subtracted without draws."""
JUMP: Final = 2
"""Thresholds of that excess that are still drawn one by one."""
NOISIEST: Final = LARGEST / 64
"""Largest threshold noise, electrons: draws stay far within int64, and steps of a table below 2^48
units."""
DEEPEST: Final = -(1 << 61)
"""Lowest deficit under `subtract`: 2^21 electrons beyond a threshold."""


@dataclass(eq=False)
class PixelState:
    """State of n pixels.

    Attributes:
        deficit: (n,) int64, threshold - charge - 1 in Q24.40.
        spikes: (n,) uint64, index of the current interval.
    """

    deficit: Charge
    spikes: npt.NDArray[np.uint64]


class Drawing(Protocol):
    """The part of an effect that the model reads: the random stream of its draws."""

    @property
    def stream(self) -> Stream: ...


@dataclass(frozen=True)
class ExactModel:
    """Parameters of the exact pixel.

    Attributes:
        threshold: electrons, positive, below 2^21.
        seed: seed of the run, below 2^32.
        effects: the inherent effects that are kept.
        threshold_noise: standard deviation in electrons, drawn anew for each spike (kTC,
            comparator).
        reset: reset rule.
        dead_time: share of a cycle after each spike during which light is lost, 0 to 1.
        shift: electrons that every interval needs beyond its threshold, from the delay of the
            comparator or an incomplete reset; its magnitude is below half a threshold.
        transfers: maps of the charge of a cycle, in their order.
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
        most = min(self.threshold, NOISIEST)
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
        """Mean charge of an interval, electrons."""
        return self.threshold + self.shift

    @property
    def q(self) -> int:
        """Mean charge of an interval in Q24.40, at least one unit."""
        return max(round(self.mean * ONE), 1)

    @property
    def room(self) -> int:
        """ROOM thresholds in Q24.40, clipped to int64."""
        return min(ROOM * self.q, 2**63 - 1)

    @property
    def dead(self) -> int:
        """Dead time in 2^-16 of a cycle."""
        return round(self.dead_time * 65536)

    @property
    def shot(self) -> bool:
        """Whether shot noise is kept."""
        return any(effect.stream is Stream.SHOT_NOISE for effect in self.effects)

    @property
    def random_start(self) -> bool:
        """Whether the initial charge is random."""
        return any(effect.stream is Stream.INITIAL_CHARGE for effect in self.effects)

    @property
    def noisy(self) -> bool:
        """Whether the threshold of each spike is drawn."""
        return self.shot or self.threshold_noise > 0

    def table(self) -> Charge:
        """Quantiles of the thresholds; see `interval_table`."""
        return self._shifted(interval_table(self.threshold, self.threshold_noise, self.shot))

    def _shifted(self, table: Charge) -> Charge:
        """The table with `shift` added."""
        if not self.shift:
            return table
        shifted: Charge = np.maximum(table + round(self.shift * ONE), 1)
        shifted.setflags(write=False)
        return shifted

    def first_table(self) -> Charge:
        """Quantiles of the interval in which a run starts, which is weighted by its length.

        Weighted by length, Gamma(Q) becomes Gamma(Q + 1), and the mean of any distribution grows by
        variance / mean.
        """
        longer = self.threshold + self.shot + self.threshold_noise**2 / self.threshold
        return self._shifted(interval_table(longer, self.threshold_noise, self.shot))

    def first_thresholds(self, pixels: npt.NDArray[np.uint32]) -> Charge:
        """Thresholds of the intervals in which a run starts, (n,) Q24.40."""
        if not self.noisy:
            return np.full(pixels.shape, self.q, np.int64)
        table = self.first_table() if self.random_start else self.table()
        return first_thresholds(table, pixels, self.seed)

    def initial(self, pixels: npt.NDArray[np.uint32]) -> PixelState:
        """State of the pixels with these numbers before the first cycle."""
        beyond, spikes = round(self.shift * ONE), np.zeros(pixels.shape, np.uint64)
        if pixels.size >= _LARGE:
            from sensor.latched.pixel.draws import first_deficits

            table = NO_TABLE
            if self.noisy:
                table = self.first_table() if self.random_start else self.table()
            out = np.empty(pixels.shape, np.int64)
            first_deficits(
                pixels, np.uint64(self.seed), table, self.noisy, self.q, self.random_start, beyond,
                out,
            )  # fmt: skip
            return PixelState(out, spikes)
        first = self.first_thresholds(pixels)
        if self.random_start:  # the charge is a share of the threshold itself
            deficit = initial_deficit(np.maximum(first - beyond, 1), pixels, self.seed) + beyond
        else:
            deficit = first - 1
        return PixelState(deficit, spikes)


class ExactPixels(Protocol):
    """A set of exact pixels. All forms give the same bits."""

    def expose(self, spans: Iterable[Span], cycles: int) -> npt.NDArray[np.uint32]:
        """Words (ceil(cycles / 32), n) of the next cycles. The spans fill them without gaps."""

    def state(self) -> PixelState:
        """The current state, as copies."""

    def restore(self, state: PixelState) -> None:
        """Continues from a state."""
