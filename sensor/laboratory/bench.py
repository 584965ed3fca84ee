"""The bench: uniform light, the pixels of a camera, stacks of frames.

Light is stated as photons at 555 nm on the area of a pixel (one lux is 4.09e15 photons/(s m^2)).
The exposure time is constant and the light varies (the first method of EMVA 1288). Each frame has a
number of its own, so that no two share their noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.light.radiometry import photons_per_lux
from cosim.plan.effects import Effect
from sensor.frame_pixels import Exposed

Values = npt.NDArray[np.float64]
LEAST_VARIANCE = 0.24
"""DN^2 in the dark below which rounding hides the noise (EMVA 1288): 0.4^2 and 1/12."""
DEAF = "these pixels must respond to light, and do not up to 1e15 photons"
_FINE = np.linspace(0.78, 1.12, 18)
"""Levels about saturation, in what `find_saturation` found: the variance's peak is sought there."""


class Pixels(Protocol):
    """What the bench needs of a `PixelModel`."""

    @property
    def effects(self) -> Mapping[str, Effect]: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def bits(self) -> int: ...

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]: ...


@dataclass(frozen=True, eq=False)
class Stack:
    """Statistics of the frames at one level of light.

    Attributes:
        photons: mean per pixel.
        seconds: exposure time.
        mean, variance: mean and variance of each pixel over the frames, DN and DN^2, (rows, W); the
            variance is unbiased.
        frames: their number.
    """

    photons: float
    seconds: float
    mean: Values
    variance: Values
    frames: int

    @property
    def spatial(self) -> Values:
        """What each pixel adds to the spatial variance, DN^2, less what is left of the temporal
        noise in a mean of so many frames (EMVA 1288: s^2 - sigma^2/L)."""
        return (self.mean - self.mean.mean()) ** 2 - self.variance / self.frames


@dataclass
class Bench:
    """Uniform light and stacks of frames.

    Attributes:
        pixels: pixels to be measured.
        area: area of a pixel that gathers light, m^2; quantum efficiency is stated relative to it.
        seconds: exposure time.
        dark_seconds: exposure times in the dark, at least two.
        rows, first: number of rows that are read, and the first of them.
        levels: number of levels of light over the range of the fit.
        frames: number of frames at each level.
        stack: frames in the dark and at half of saturation, where spatial variances are measured.
        seed: seed of the temporal noise.
        kept: effects; all if None.
        start: number of the first frame.
        columns: first and number of the columns that count; all if None.
        bias: photons per exposure that also shine in the "dark"; None for as many as are needed, 0
            for EMVA 1288. A camera without black level clips what lies below zero, and one of few
            bits hides its noise by rounding. Light that lifts the value off zero and has noise of
            its own avoids both; its known share is subtracted.
        dark_bias: photons per exposure while dark current and DSNU are measured; as `bias` if
            None. 0 suits a count, whose mean rounding does not shift.
        linear: share of saturation up to which slopes are fitted, 0.7 in EMVA 1288. Where few
            electrons fill the scale (an EBAPS at high voltage: some ten) the upper tail of their
            law is clipped long before the mean is full, and the share must be less.
    """

    pixels: Pixels
    area: float
    seconds: float
    dark_seconds: tuple[float, ...]
    rows: int = 64
    first: int = 0
    levels: int = 14
    frames: int = 8
    stack: int = 64
    seed: int = 1
    kept: frozenset[str] | None = None
    start: int = 0
    columns: tuple[int, int] | None = None
    bias: float | None = 0.0
    linear: float = 0.7
    dark_bias: float | None = None
    _taken: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        height, width = self.pixels.shape
        begin, count = self.columns or (0, width)
        inside = 1 <= self.rows <= height - self.first and 0 <= begin <= width - count
        if not inside or self.rows * count < 1000:
            raise ValueError("a bench must read 1000 pixels or more, of those that there are")
        if len(set(self.dark_seconds)) < 2 or self.levels < 3 or min(self.frames, self.stack) < 2:
            raise ValueError("a bench needs 2 dark exposures, 3 levels and stacks of 2 frames")
        if not (self.area > 0 and self.seconds > 0):
            raise ValueError("area and seconds must be above 0")

    @property
    def top(self) -> int:
        """Largest value, DN."""
        return (1 << self.pixels.bits) - 1

    def take(self, photons: float, seconds: float, frames: int) -> Stack:
        """A stack under this light."""
        width = self.pixels.shape[1]
        lux_seconds = photons / (self.area * photons_per_lux(555))
        light = np.full((self.rows, width), lux_seconds)
        every = frozenset(self.pixels.effects) if self.kept is None else self.kept
        begin, count = self.columns or (0, width)
        total = np.zeros((self.rows, count), np.int64)
        squares = np.zeros_like(total)
        for _ in range(frames):
            exposed = Exposed(
                light, np.full(self.rows, seconds), np.zeros(self.rows), self.first,
                self.start + self._taken,
            )  # fmt: skip
            self._taken += 1
            values = self.pixels.convert(exposed, self.seed, every)[:, begin : begin + count]
            values = values.astype(np.int64)
            total += values
            squares += values**2
        variance = (squares - total**2 / frames) / (frames - 1)
        return Stack(photons, seconds, total / frames, variance, frames)

    def dark(self, seconds: float) -> Stack:
        """A long stack under the bias alone."""
        if self.bias is None:
            self.bias = self._find_bias()
        return self.take(self.bias, seconds, self.stack)

    def unlit(self, seconds: float) -> Stack:
        """A long stack under the bias of dark current and DSNU."""
        if self.dark_bias is None:
            return self.dark(seconds)
        return self.take(self.dark_bias, seconds, self.stack)

    def _find_bias(self) -> float:
        """The least of 0, 1, 2, 4, ... photons under which hardly a value is 0 and noise spans
        half a DN, before rounding."""
        photons = 0.0
        while photons < 1e15:
            stack = self.take(photons, self.seconds, 8)
            spread = float(stack.variance.mean())
            low = float((stack.mean - 4 * np.sqrt(stack.variance) < 1).mean())
            if low < 0.01 and spread > LEAST_VARIANCE + 1 / 12:
                return photons
            photons = max(1.0, 2 * photons)
        raise ValueError(DEAF)

    def find_saturation(self) -> float:
        """Photons at which the mean comes within 2 % of where it stops growing."""
        dark = float(self.take(0, self.seconds, 2).mean.mean())
        photons, last = 1.0, dark
        while photons < 1e15:
            value = float(self.take(photons, self.seconds, 2).mean.mean())
            # A step is fourfold: what grows by less than a twentieth of all its signal is full.
            if value - dark > 0.02 * self.top and value - last < 0.05 * (value - dark):
                break
            photons, last = 4 * photons, value
        else:
            raise ValueError(DEAF)
        low, high, goal = photons / 64, photons, dark + 0.98 * (value - dark)
        for _ in range(9):
            middle = (low + high) / 2
            if float(self.take(middle, self.seconds, 2).mean.mean()) < goal:
                low = middle
            else:
                high = middle
        return high


def take_levels(bench: Bench) -> Iterator[Stack]:
    """Stacks under rising light: evenly over the fit's range, then finely past saturation."""
    full = bench.find_saturation()
    bias = bench.bias or 0.0
    straight = bias + np.arange(1, bench.levels + 1) * (bench.linear * full - bias) / bench.levels
    for photons in (*straight, *(_FINE * full)):
        yield bench.take(float(photons), bench.seconds, bench.frames)
