"""Time of symbols in the camera's ticks, and place of panel pixels on its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Timing:
    """Timing of the symbols: symbol n begins in camera row r at tick first + n period + slope r /
    rows.

    Tick k is what the row latches in cycle k: the light from its sampling instant of cycle k - 1 to
    that of cycle k.

    Attributes:
        first: begin of symbol 0 in row 0, ticks.
        period: ticks of a symbol, those of the mode but for the clock offset.
        slope: delay of the last row against the first, ticks; 0 if the panel scans in step with the
            camera.
        rows: number of rows of the camera.
    """

    first: float
    period: float
    slope: float
    rows: int

    def start(self, symbol: npt.ArrayLike, row: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Tick at which symbols begin in rows, broadcast together."""
        n, r = np.asarray(symbol, np.float64), np.asarray(row, np.float64)
        return self.first + n * self.period + self.slope * r / self.rows


@dataclass(frozen=True, eq=False)
class Registration:
    """Place of the panel's pixels in the image.

    Attributes:
        homography: (3, 3) float64, from panel to camera pixels, both (x, y, 1) with pixel centres
            at integers.
        drift: (n, 3) float64, rows (tick, dx, dy) in order of ticks: displacement of the image,
            camera pixels, linear in between; empty without drift.
        blur: standard deviation of the image's blur, camera pixels.
    """

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
        """Displacement (dx, dy) of the image at a tick."""
        dx, dy = self.shifts(np.array([tick]))[0]
        return float(dx), float(dy)

    def shifts(self, ticks: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Displacements (dx, dy) of the image at ticks, (n, 2)."""
        if not len(self.drift):
            return np.zeros((len(ticks), 2))
        at, dx, dy = self.drift.T
        return np.column_stack([np.interp(ticks, at, dx), np.interp(ticks, at, dy)])
