"""Blur of what moves: how long a span of the scene an image is the mean of, and how far edges go in
it.

A camera that gathers light for a time w shows the mean of the scene over w, and an edge that passes
at a speed v is then a ramp of v w pixels, 10 to 90 % of it 0.8 v w. Both are taken from what was
made: w from the image by least squares against such means of the truth, v from the truth itself
(its change in time over its gradient). A mean longer than the scene's own detail turns contrast
around, which no widening of edges explains; such means do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from cosim import PS

__all__ = ["RAMP", "Motion"]

RAMP: Final = 0.8
"""10 to 90 % of a linear ramp, over its length."""
BANDS: Final = 10
"""Bands of rows, each compared with the scene at its own middle."""
_LEAST: Final = 200
"""Pixels at least that must move."""
_CHANGE: Final = 0.05
"""Of reflectance: what counts as moving, and as an edge (a pixel)."""
Image = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass(eq=False)
class Motion:
    """The scene around an instant. truth: reflectance by ps. reach: ps on either side that means
    may reach. step: ps between the planes that they are made of. last: ps of the scene's end."""

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
        self._range = np.ptp(planes, axis=0)
        widths = np.diff(self._times).astype(np.float32)[:, None, None]
        parts = (planes[1:] + planes[:-1]) / 2 * widths
        self._sum = np.concatenate([np.zeros_like(planes[:1]), np.cumsum(parts, axis=0)])

    def moving(self) -> Mask | None:
        """Where the scene changes within reach; None where too little does."""
        found = self._range > _CHANGE
        return found if found.sum() >= _LEAST else None

    def _until(self, time: float, rows: slice) -> Image:
        """Integral of the truth up to a time."""
        place = np.interp(time, self._times, np.arange(self._times.size))
        low = min(int(place), self._times.size - 2)
        share = place - low
        part = self._sum[:, rows]
        return np.asarray((1 - share) * part[low] + share * part[low + 1], np.float64)

    def mean(self, instants: npt.NDArray[np.int64], span: float) -> Image:
        """The truth, mean over `span` ps around each row's own instant. instants: (H,) ps."""
        span, parts = max(span, float(self.step)), []
        for band in np.array_split(np.arange(instants.size), BANDS):
            rows, middle = slice(int(band[0]), int(band[-1]) + 1), float(np.median(instants[band]))
            a = max(middle - span / 2, self._times[0])
            b = min(middle + span / 2, self._times[-1])
            parts.append((self._until(b, rows) - self._until(a, rows)) / max(b - a, 1.0))
        return np.concatenate(parts)

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
        what moves; None where no mean explains a twentieth of what varies there."""
        where = self.moving()
        if where is None:
            return None
        seen = image[where] - image[where].mean()
        power = float(seen @ seen)
        if power <= 0:
            return None

        def left(log_span: float) -> float:
            trial = self.mean(instants, float(np.exp(log_span)))[where]
            trial -= trial.mean()
            own, along = float(trial @ trial), float(trial @ seen)
            return 1 - (along * along / own / power if own > 0 and along > 0 else 0.0)

        grid = np.log(np.geomspace(self.step, self._times[-1] - self._times[0], 16))
        values = [left(float(s)) for s in grid]
        at = int(np.argmin(values))
        if values[at] > 0.95:
            return None
        ends = float(grid[max(at - 1, 0)]), float(grid[min(at + 1, grid.size - 1)])
        found = minimize_scalar(left, bounds=ends, method="bounded", options={"xatol": 0.01})
        best = float(found.x) if float(found.fun) < values[at] else float(grid[at])
        return float(np.exp(best)) / PS

    def blur(self, image: Image, instants: npt.NDArray[np.int64]) -> float | None:
        """10 to 90 % width in pixels of an edge that moves as fast as the mean one."""
        speed, span = self.speed(), self.span(image, instants)
        return None if speed is None or span is None else RAMP * speed * span
