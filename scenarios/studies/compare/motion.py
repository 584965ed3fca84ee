"""Blur of what moves: how long a span of the scene an image is the mean of, and how far edges go in
it.

A camera that gathers light for a time w shows the mean of the scene over w, and an edge that passes
at a speed v is then a ramp of v w pixels, 10 to 90 % of it 0.8 v w. Both are taken from what was
made: w from the image by least squares against such means of the truth, v from the truth itself
(its change in time over its gradient). A mean longer than the scene's own detail turns contrast
around, which no widening of edges explains; such means do.

In a scene that repeats itself (spokes that pass every 6.9 ms, bars of one width) a mean over w and
one over w and a whole repeat, or over what w lacks of a repeat, look alike but for their contrast.
So the residual has many minima, and spans are tried one step of the scene after the other; a search
by factors of 1.4 ended in a neighbour (44 ms for 33 ms). Among the minima the contrast decides: the
image is an estimate of reflectance, so its gain is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from cosim import PS

__all__ = ["RAMP", "Motion"]

RAMP: Final = 0.8
"""10 to 90 % of a linear ramp, over its length."""
_LEAST: Final = 200
"""Pixels at least that must move."""
_FINE: Final = 0.01
"""Of a step: how closely a span is sought."""
_TRIED: Final = 8
"""Minima, the least first, that are refined."""
_CHANGE: Final = 0.05
"""Of reflectance: what counts as moving, and as an edge (a pixel)."""
Image = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


def _minima(values: Sequence[float]) -> list[int]:
    """Places of local minima, the least first."""
    padded = [math.inf, *values, math.inf]
    found = [n for n, value in enumerate(values) if padded[n] > value <= padded[n + 2]]
    return sorted(found, key=lambda n: values[n])


@dataclass(eq=False)
class Motion:
    """The scene around an instant.

    Attributes:
        truth: reflectance at an instant, ps.
        instant: in question, ps.
        reach: on either side, within which means lie, ps.
        step: between the planes that means are taken of, ps.
        last: end of the scene, ps.
    """

    truth: Callable[[int], Image]
    instant: int
    reach: int
    step: int
    last: int

    def __post_init__(self) -> None:
        begin, end = max(self.instant - self.reach, 0), min(self.instant + self.reach, self.last)
        count = max(-(-(end - begin) // self.step), 2)
        self._times = np.linspace(begin, end, count + 1)
        planes = np.stack([self.truth(int(t)).astype(np.float32) for t in self._times])
        self._planes, self._range = planes, np.ptp(planes, axis=0)
        widths = np.diff(self._times).astype(np.float32)[:, None, None]
        parts = (planes[1:] + planes[:-1]) / 2 * widths
        self._sum = np.concatenate([np.zeros_like(planes[:1]), np.cumsum(parts, axis=0)])

    def moving(self) -> Mask | None:
        """Where the scene changes within reach; None where too little does."""
        found = self._range > _CHANGE
        return found if found.sum() >= _LEAST else None

    def _until(self, times: npt.NDArray[np.float64]) -> Image:
        """Integral of the truth, linear between its planes, up to a time of each row's own, (H,)
        ps."""
        place = np.interp(times, self._times, np.arange(self._times.size))
        low = np.minimum(place.astype(np.int64), self._times.size - 2)
        share, rows = (place - low)[:, None], np.arange(times.size)
        width = np.diff(self._times)[low][:, None] * share
        first, last = self._planes[low, rows], self._planes[low + 1, rows]
        inside = ((1 - share / 2) * first + share / 2 * last) * width
        return np.asarray(self._sum[low, rows] + inside, np.float64)

    def mean(self, instants: npt.NDArray[np.int64], span: float) -> Image:
        """The truth, mean over `span` ps around each row's own instant. instants: (H,) ps."""
        span = max(span, float(self.step))
        a = np.maximum(instants - span / 2, self._times[0])
        b = np.minimum(instants + span / 2, self._times[-1])
        return (self._until(b) - self._until(a)) / np.maximum(b - a, 1.0)[:, None]

    def speed(self) -> float | None:
        """Pixels a second: what changes in a moment over all gradients, of the edges that move."""
        dt = PS // 20_000
        before, after = (
            np.asarray(self.truth(max(self.instant + s, 0)), np.float64) for s in (-dt, dt)
        )
        gradient = np.hypot(*np.gradient((before + after) / 2))
        edges = (gradient > _CHANGE) & (self._range > _CHANGE)
        if edges.sum() < _LEAST:
            return None
        change = np.abs(after - before)[edges].sum() / (2 * dt / PS)
        return float(change / gradient[edges].sum())

    def span(self, image: Image, instants: npt.NDArray[np.int64]) -> float | None:
        """Seconds of scene whose mean the image is, by least squares with a gain and an offset over
        what moves; None where no mean explains a twentieth of what varies there.

        image: an estimate of reflectance, whose gain is 1 but for what its camera adds. Of the
        spans that fit better than their neighbours the one that fits best at a gain of 1 counts.
        """
        where = self.moving()
        if where is None:
            return None
        contrast = image[where] - image[where].mean()
        power = float((contrast * contrast).sum())
        if power <= 0:
            return None

        def fit(span: float) -> tuple[float, float]:
            """Share that is left unexplained at the best gain, and at a gain of 1."""
            trial = self.mean(instants, span)[where]
            trial -= trial.mean()
            own, along = float((trial * trial).sum()), float((trial * contrast).sum())
            at_one = 1 + (own - 2 * along) / power
            return 1 - (along * along / own / power if own > 0 < along else 0.0), at_one

        grid = np.arange(1, int((self._times[-1] - self._times[0]) / self.step) + 1) * self.step
        values = [fit(float(s))[0] for s in grid]
        found = [self._refined(fit, grid, at) for at in _minima(values)[:_TRIED]]
        if not found or min(found)[0] > 0.95:
            return None
        return min(found, key=lambda each: each[2])[1] / PS

    def _refined(
        self, fit: Callable[[float], tuple[float, float]], grid: Any, at: int
    ) -> tuple[float, float, float]:
        """The minimum around a place of the grid: share left, span, share left at a gain of 1."""
        ends = float(grid[max(at - 1, 0)]), float(grid[min(at + 1, grid.size - 1)])
        if ends[0] < ends[1]:
            found = minimize_scalar(
                lambda span: fit(span)[0], bounds=ends, method="bounded",
                options={"xatol": _FINE * self.step},
            )  # fmt: skip
            if float(found.fun) < fit(float(grid[at]))[0]:
                return float(found.fun), float(found.x), fit(float(found.x))[1]
        left, at_one = fit(float(grid[at]))
        return left, float(grid[at]), at_one

    def blur(self, image: Image, instants: npt.NDArray[np.int64]) -> float | None:
        """10 to 90 % width in pixels of an edge that moves as fast as the mean one."""
        speed, span = self.speed(), self.span(image, instants)
        return None if speed is None or span is None else RAMP * speed * span
