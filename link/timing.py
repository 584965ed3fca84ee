"""When symbols fall on the camera's ticks, and where panel pixels fall on its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Registration", "Timing"]


@dataclass(frozen=True)
class Timing:
    """Symbol n begins, for camera row r of `rows`, at tick first + n period + slope r / rows.

    Tick k is what the row latched in cycle k: light from its sampling instant of cycle k - 1 to
    that of cycle k. first, period, slope: in ticks; period is the mode's ticks but for the clocks'
    offset; slope is 0 where the panel scans in step with the camera.
    """

    first: float
    period: float
    slope: float
    rows: int

    def start(self, symbol: npt.ArrayLike, row: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Tick at which symbols begin for rows, broadcast together."""
        n, r = np.asarray(symbol, np.float64), np.asarray(row, np.float64)
        return self.first + n * self.period + self.slope * r / self.rows


@dataclass(frozen=True, eq=False)
class Registration:
    """homography: (3, 3) float64, from panel to camera pixels, both (x, y, 1) with pixel centres at
    whole numbers. drift: (ticks, dx, dy) rows, (n, 3) float64, in order of ticks: what the image
    has moved by then, camera pixels, linear in between; empty where it stands still. blur: standard
    deviation of the image's blur, camera pixels."""

    homography: npt.NDArray[np.float64]
    drift: npt.NDArray[np.float64]
    blur: float = 0.0

    def camera(
        self, x: npt.ArrayLike, y: npt.ArrayLike, tick: float | None = None
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Camera (x, y) of panel pixels, at a tick, or without drift."""
        x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        u, v, w = np.tensordot(self.homography, np.stack([x, y, np.ones_like(x)]), 1)
        dx, dy = self.shift(tick) if tick is not None else (0.0, 0.0)
        return u / w + dx, v / w + dy

    def shift(self, tick: float) -> tuple[float, float]:
        """(dx, dy) of the image by a tick."""
        if not len(self.drift):
            return 0.0, 0.0
        at, dx, dy = self.drift.T
        return float(np.interp(tick, at, dx)), float(np.interp(tick, at, dy))
