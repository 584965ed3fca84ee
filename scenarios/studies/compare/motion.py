"""Motion blur of an image: its exposure time multiplied by the speed of the edges.

An image of a camera that integrates light for a time w is the mean of the scene over w. An edge
that moves at the speed v becomes a ramp of v w pixels; its 10 to 90 % width is 0.8 v w. Both are
measured: w by a least-squares fit of the image with means of the truth, v from the truth (its
change in time over its gradient). A mean over more than the period of the scene's detail inverts
the contrast; a fit with wider edges cannot explain this, but a fit with means can.

In a periodic scene (spokes that pass every 6.9 ms, bars of one width), a mean over w, over w plus a
period, and over a period minus w differ only in contrast. The residual then has many minima.
Therefore every span is tried, in steps of the scene; a search by factors of 1.4 ended in a wrong
minimum (44 ms for 33 ms). Among the minima the contrast decides: the image is an estimate of
reflectance, so its gain is known.
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
from scenarios.studies.compare.measure import still_blur

RAMP: Final = 0.8
"""10 to 90 % width of a linear ramp over its length."""
_LEAST: Final = 200
"""Minimum number of moving pixels for a measurement."""
_FINE: Final = 0.01
"""Tolerance of the search for a span, in steps."""
_TRIED: Final = 8
"""Number of minima, the lowest first, that are refined."""
_CHANCE: Final = 6.63
"""Chi-square of one degree of freedom that chance exceeds in 1 % of the cases."""
_CHANGE: Final = 0.05
"""Change of reflectance in time that counts as motion, and per pixel as an edge."""
Image = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


def _minima(values: Sequence[float]) -> list[int]:
    """Indices of the local minima, the lowest first."""
    padded = [math.inf, *values, math.inf]
    minima = [n for n, value in enumerate(values) if padded[n] > value <= padded[n + 2]]
    return sorted(minima, key=lambda n: values[n])


@dataclass(eq=False)
class Motion:
    """The scene around an instant.

    Attributes:
        truth: function from an instant, ps, to the true reflectance, (H, W).
        instant: instant of the images, ps.
        reach: extent of the means before and after the instant, ps.
        step: time between the planes of which means are computed, ps.
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
        """The pixels whose light changes within reach, (H, W); None for fewer than _LEAST."""
        moving = self._range > _CHANGE
        return moving if moving.sum() >= _LEAST else None

    def _until(self, times: npt.NDArray[np.float64]) -> Image:
        """Integral of the truth from the first plane to the time of each row, with linear
        interpolation. `times`: (H,), ps. Returns (H, W), ps."""
        place = np.interp(times, self._times, np.arange(self._times.size))
        low = np.minimum(place.astype(np.int64), self._times.size - 2)
        share, rows = (place - low)[:, None], np.arange(times.size)
        width = np.diff(self._times)[low][:, None] * share
        first, last = self._planes[low, rows], self._planes[low + 1, rows]
        inside = ((1 - share / 2) * first + share / 2 * last) * width
        return np.asarray(self._sum[low, rows] + inside, np.float64)

    def mean(self, instants: npt.NDArray[np.int64], span: float) -> Image:
        """Mean of the truth over `span`, ps, around the instant of each row. `instants`: (H,),
        ps."""
        span = max(span, float(self.step))
        a = np.maximum(instants - span / 2, self._times[0])
        b = np.minimum(instants + span / 2, self._times[-1])
        return (self._until(b) - self._until(a)) / np.maximum(b - a, 1.0)[:, None]

    def speed(self) -> float | None:
        """Mean speed of moving edges, pixels/s: the sum of changes in time over the sum of
        gradients. None for fewer than _LEAST pixels."""
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
        """The span of the scene whose mean fits the image best, by least squares with a gain and an
        offset over the moving pixels. Among the local minima, the one with the best fit at a gain
        of 1 is selected.

        Args:
            image: estimate of reflectance, (H, W); its gain is nearly 1.
            instants: centre of the exposure of each row, (H,), ps.

        Returns:
            The span, s; None if no mean explains a twentieth of the variance.
        """
        where = self.moving()
        if where is None:
            return None
        contrast = image[where] - image[where].mean()
        power = float((contrast * contrast).sum())
        if power <= 0:
            return None

        def fit(span: float) -> tuple[float, float]:
            """Unexplained share of the variance at the best gain, and at a gain of 1."""
            trial = self.mean(instants, span)[where]
            trial -= trial.mean()
            square, product = float((trial * trial).sum()), float((trial * contrast).sum())
            at_one = 1 + (square - 2 * product) / power
            return 1 - (product * product / square / power if square > 0 < product else 0.0), at_one

        grid = np.arange(1, int((self._times[-1] - self._times[0]) / self.step) + 1) * self.step
        values = [fit(float(s))[0] for s in grid]
        minima = [self._refined(fit, grid, at) for at in _minima(values)[:_TRIED]]
        if not minima or min(minima)[0] > 0.95:
            return None
        return min(minima, key=lambda each: each[2])[1] / PS

    def _refined(
        self, fit: Callable[[float], tuple[float, float]], grid: Any, at: int
    ) -> tuple[float, float, float]:
        """The minimum near index `at` of the grid: unexplained share at the best gain, span, and
        unexplained share at a gain of 1."""
        ends = float(grid[max(at - 1, 0)]), float(grid[min(at + 1, grid.size - 1)])
        if ends[0] < ends[1]:
            best = minimize_scalar(
                lambda span: fit(span)[0], bounds=ends, method="bounded",
                options={"xatol": _FINE * self.step},
            )  # fmt: skip
            if float(best.fun) < fit(float(grid[at]))[0]:
                return float(best.fun), float(best.x), fit(float(best.x))[1]
        residual, at_one = fit(float(grid[at]))
        return residual, float(grid[at]), at_one

    def _shorter_fits(
        self, image: Image, instants: npt.NDArray[np.int64], span: float, where: Mask
    ) -> bool:
        """Whether the scene without a mean explains the image as well as its mean over `span`, s:
        the improvement is below what the noise of the image brings by chance."""
        sharp, mean = (
            self.mean(instants, length)[where] for length in (float(self.step), span * PS)
        )
        errors = []
        for trial in (sharp, mean):
            shape = np.stack([trial - trial.mean(), np.ones(trial.size)], 1)
            rest = image[where] - shape @ np.linalg.lstsq(shape, image[where], rcond=None)[0]
            errors.append(float(rest @ rest))
        return errors[0] - errors[1] < _CHANCE * errors[1] / where.sum()

    def blur(self, image: Image, instants: npt.NDArray[np.int64]) -> tuple[float | None, str]:
        """10 to 90 % width of an edge at the mean speed, pixels, and "" or why it is not known."""
        speed, where = self.speed(), self.moving()
        if speed is None or where is None:
            return None, "the scene has no edge that moves and is sharp enough to measure blur"
        span = self.span(image, instants)
        if span is None:
            return None, "no exposure of the scene explains the image: blur is unknown"
        if self._shorter_fits(image, instants, span, where):
            return None, "the edges of the scene are too soft or too slow to measure blur"
        return RAMP * speed * span, ""


def edge_blur(
    motion: Motion, image: Image, truth: Image, instants: npt.NDArray[np.int64]
) -> tuple[float | None, str]:
    """10 to 90 % width of an edge, pixels, and "" or why it is not known; of the static scene where
    nothing moves. truth: true reflectance at the instant, (H, W); others as `Motion.blur`."""
    if motion.moving() is not None:
        return motion.blur(image, instants)
    width = still_blur(image, truth)
    return width, "" if width is not None else "the image is too unlike the scene to measure blur"
