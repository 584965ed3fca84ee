"""The frame pixel: what the pixels of all imagers with frames have in common.

Photoelectrons are Poisson counts of the light, with the response of each pixel. Dark current adds
Poisson counts of its own, with a rate that differs from pixel to pixel. The signal chain adds
normal noise, and a converter rounds. Each step is left out with its effect and has its own stream
of random numbers, by seed, pixel and frame, so a step draws the same whatever else is kept.

An imager calls these steps in the order of its signal chain and adds what is its own: multiplied
electrons, wells that spill, pulses. `FixedPattern` draws what differs between the pixels of one
device; `steady_effects`, `noise_change` and `summary_of` serve the bounds of effects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.draws import normal, poisson
from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.frame_pixels import Exposed, ImagerSummary

Values = npt.NDArray[np.float64]
Pattern = Callable[[], Values]
"""Makes a fixed pattern of all rows, (H, W) or (H, 1); called only if it is used."""


@dataclass(frozen=True, eq=False)
class Conversion:
    """Rows of a frame on their way from light to digital numbers.

    Attributes:
        first: number of the first row.
        shape: (rows, W).
        frame: number of the frame.
        seed: seed of the temporal noise.
        kept: names of the effects that are computed.
    """

    first: int
    shape: tuple[int, int]
    frame: int
    seed: int
    kept: frozenset[str]

    @classmethod
    def of(cls, rows: Exposed, seed: int, kept: frozenset[str]) -> Conversion:
        """The conversion of exposed rows."""
        return cls(rows.first, rows.lux_seconds.shape[:2], rows.frame, seed, kept)

    def window(self, first: int, count: int) -> Conversion:
        """The conversion of `count` rows from the row `first` of these on."""
        shape = count, self.shape[1]
        return Conversion(self.first + first, shape, self.frame, self.seed, self.kept)

    @cached_property
    def numbers(self) -> npt.NDArray[np.int64]:
        """(rows, W) numbers of the pixels in their imager, which is W wide."""
        count, width = self.shape
        numbers = np.arange(self.first * width, (self.first + count) * width, dtype=np.int64)
        return numbers.reshape(self.shape)

    def part(self, pattern: Values) -> Values:
        """The rows of a pattern of the whole imager."""
        return pattern[self.first : self.first + self.shape[0]]

    def times(self, values: Values, effect: str, pattern: Pattern) -> Values:
        """Values times the factor of each pixel or row, such as its response."""
        return values * self.part(pattern()) if effect in self.kept else values

    def counts(self, mean: npt.ArrayLike, effect: str, stream: Stream) -> Values:
        """(rows, W) Poisson counts of these means; without the effect the means themselves."""
        if effect not in self.kept:
            given = np.asarray(mean, np.float64)
            return given if given.shape == self.shape else np.broadcast_to(given, self.shape)
        return poisson(mean, self.numbers, self.frame, self.seed, stream).astype(np.float64)

    def dark(
        self, rate: float, seconds: Values, pattern: Pattern | None = None, most: float = math.inf
    ) -> Values | float:
        """Mean dark electrons, (rows, W) or (rows, 1); 0 without the effect "dark current".

        Args:
            rate: mean of the pixels, e/s.
            seconds: (rows,) time that they are gathered, s.
            pattern: rate of each pixel over the mean, the effect "DSNU"; None for equal pixels.
            most: limit of the mean, e.
        """
        if "dark current" not in self.kept:
            return 0.0
        mean = (rate * seconds)[:, None]
        if pattern is not None and "DSNU" in self.kept:
            mean = mean * self.part(pattern())
        return np.minimum(mean, most)

    def dark_counts(
        self, rate: float, seconds: Values, pattern: Pattern | None = None, most: float = math.inf,
        effect: str = "dark shot noise",
    ) -> Values | float:  # fmt: skip
        """Dark electrons, Poisson counts of `dark` with the effect `effect`; 0 without dark
        current."""
        mean = self.dark(rate, seconds, pattern, most)
        return mean if isinstance(mean, float) else self.counts(mean, effect, Stream.IMAGER_DARK)

    def noisy(self, values: Values, deviation: float, effect: str, stream: Stream) -> Values:
        """Values with normal noise of this deviation, in their unit."""
        if effect not in self.kept or not deviation:
            return values
        return values + deviation * normal(self.numbers, self.frame, self.seed, stream)


def digitised(values: Values, bits: int) -> npt.NDArray[np.uint16]:
    """Values of a converter, DN: rounded to whole numbers of this many bits, clipped at both
    ends."""
    return np.clip(np.rint(values), 0, (1 << bits) - 1).astype(np.uint16)


@dataclass(eq=False)
class FixedPattern:
    """Random numbers of the pixels of one device, the same in every frame; each is drawn once.

    Attributes:
        shape: (H, W) of the imager.
        seed: seed of the device.
    """

    shape: tuple[int, int]
    seed: int
    _made: dict[Any, Values] = field(default_factory=dict)

    def once(self, key: Any, make: Pattern) -> Values:
        """What `make` returns, kept under a key."""
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    def numbers(self, shape: tuple[int, int] | None = None) -> npt.NDArray[np.int64]:
        """Numbers of the pixels, or of what else has this shape: a row, a column."""
        height, width = shape or self.shape
        return np.arange(height * width, dtype=np.int64).reshape(height, width)

    def normal(self, kind: int, shape: tuple[int, int] | None = None) -> Values:
        """Normal numbers of mean 0 and variance 1, of the shape of the imager or another.

        kind: number of the pattern, which takes the place of the frame in its draws.
        """
        return normal(self.numbers(shape), kind, self.seed, Stream.IMAGER_PATTERN)

    def factor(self, kind: int, spread: float, shape: tuple[int, int] | None = None) -> Values:
        """Factors of mean 1 and standard deviation `spread`, negative ones set to 0."""
        return self.once(
            (kind, spread), lambda: np.maximum(1 + spread * self.normal(kind, shape), 0.0)
        )


def noise_change(lost: Any, whole: Any = 1.0) -> Values:
    """Relative change of the noise if the variance `lost` of `whole` is left out:
    1 - sqrt(1 - lost / whole)."""
    share = np.clip(np.asarray(lost, np.float64) / whole, 0.0, 1.0)
    return np.asarray(1.0 - np.sqrt(1.0 - share))


def summary_of(
    electrons: tuple[float, float], seconds: tuple[float, float], frames: int, well: float,
    **more: Any,
) -> ImagerSummary:  # fmt: skip
    """The summary of a run for the bounds.

    Args:
        electrons: least and largest mean of photoelectrons in an exposure.
        seconds: shortest and longest exposure, s.
        frames: number of frames.
        well: full well, e.
        more: further attributes of `ImagerSummary`.
    """
    return ImagerSummary(*electrons, well, frames, frames, exposure=seconds, **more)


def steady_effects(
    sources: Mapping[str, tuple[Stream, str]],
    costs: Mapping[str, float],
    bound: Callable[[str], Callable[[Summary], Bound]],
) -> dict[str, Effect]:
    """Effects by name, whose costs do not depend on the scene.

    Args:
        sources: stream of random numbers and source of each effect.
        costs: ns per pixel and frame.
        bound: the bound of the effect of a name.
    """
    return {
        name: Effect(name, source, stream, bound(name), lambda scene, ns=costs[name]: ns)  # type: ignore[misc]
        for name, (stream, source) in sources.items()
    }
