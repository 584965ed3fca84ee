"""Absolute intensities: the output of continuous photographing (Huang 2022 section 3.1).

A report has the position of its pixel, the instant, and the measured photocurrent. The sequence of
a pixel's reports is a piecewise constant approximation of its current, and the last reports of all
pixels at an instant are the image of that instant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.spikes.events import time_order

Ticks = npt.NDArray[np.int64]
Places = npt.NDArray[np.uint16]
Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Intensities:
    """Reports in the order of time; those of one tick in row-major order. A pixel reports at most
    once a tick.

    Attributes:
        row, column: (n,) uint16, position of the pixel.
        time: (n,) int64, tick of the report, counted from tick 0 of `clock`.
        value: (n,) float64 >= 0, electrons a second that the code of the converter represents.
        shape: (H, W) of the plane.
        ticks: number of ticks; the stream covers start .. start + ticks - 1.
        clock: clock of the ticks.
        start: first tick.

    Raises:
        ValueError: an array has another type or length, a report is outside shape or time or out of
            order, or a value is negative or not finite.
    """

    row: Places
    column: Places
    time: Ticks
    value: Values
    shape: tuple[int, int]
    ticks: int
    clock: Clock
    start: int = 0

    def __post_init__(self) -> None:
        for name, dtype in (
            ("row", np.uint16),
            ("column", np.uint16),
            ("time", np.int64),
            ("value", np.float64),
        ):
            array = getattr(self, name)
            if array.shape != (len(self),) or array.dtype != dtype:
                raise ValueError(
                    f"{name} must be ({len(self)},) {np.dtype(dtype)}, "
                    f"not {array.shape} {array.dtype}"
                )
        if self.ticks < 1 or min(self.shape) < 1:
            raise ValueError(f"ticks and shape must be 1 or more, not {self.ticks}, {self.shape}")
        if not len(self):
            return
        if self.row.max() >= self.shape[0] or self.column.max() >= self.shape[1]:
            raise ValueError(
                f"reports must lie within {self.shape[0]} rows, {self.shape[1]} columns"
            )
        last = self.start + self.ticks - 1
        if self.time[0] < self.start or self.time[-1] > last or (np.diff(self.time) < 0).any():
            raise ValueError(f"times must rise from {self.start} to {last} or less")
        if ((np.diff(self.time) == 0) & (np.diff(self.pixel) <= 0)).any():
            raise ValueError("reports of one tick must be of pixels in order, one a pixel")
        if not ((self.value >= 0) & (self.value < np.inf)).all():
            raise ValueError("values must be finite and 0 or more")

    def __repr__(self) -> str:
        height, width = self.shape
        return (
            f"{len(self)} intensities of {width} x {height} pixels in {self.ticks} ticks at "
            f"{self.clock.hz / 1e3:g} kHz"
        )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def pixel(self) -> Ticks:
        """(n,) int64: row x W + column."""
        return self.row.astype(np.int64) * self.shape[1] + self.column

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Intensities):
            return NotImplemented
        return all(
            getattr(self, n) == getattr(other, n) for n in ("shape", "ticks", "clock", "start")
        ) and all(
            np.array_equal(getattr(self, n), getattr(other, n))
            for n in ("row", "column", "time", "value")
        )

    __hash__ = None  # type: ignore[assignment]  # compares by content, which is mutable


def join_intensities(parts: Sequence[Intensities]) -> Intensities:
    """One stream from consecutive parts. A part may begin in the last tick of the previous part, if
    the time was split within a tick.

    Raises ValueError if there is no part, if shapes or clocks differ, or for gaps and other
    overlaps.
    """
    if not parts:
        raise ValueError("at least one part must be given, not none")
    first = parts[0]
    for one, two in pairwise(parts):
        if (one.shape, one.clock) != (two.shape, two.clock):
            raise ValueError("parts must share one shape and clock")
        if one.start + one.ticks - two.start not in (0, 1):
            raise ValueError(
                f"a part must begin at tick {one.start + one.ticks}, or the one before, "
                f"not {two.start}"
            )
    time = np.concatenate([p.time for p in parts])
    order = time_order(time, np.concatenate([p.pixel for p in parts]))
    row, column, value = (
        np.concatenate([getattr(p, name) for p in parts])[order]
        for name in ("row", "column", "value")
    )
    ticks = parts[-1].start + parts[-1].ticks - first.start
    return Intensities(
        row, column, time[order], value, first.shape, ticks, first.clock, first.start
    )


def last_reports(reports: Intensities, tick: int) -> Ticks:
    """Index of the last report of each pixel up to the end of a tick, (H, W) int64; -1 if there is
    none.

    Raises ValueError for a tick outside the stream.
    """
    last = reports.start + reports.ticks - 1
    if not reports.start <= tick <= last:
        raise ValueError(f"tick must be from {reports.start} to {last}, not {tick}")
    place = np.full(reports.shape[0] * reports.shape[1], -1, np.int64)
    n = int(np.searchsorted(reports.time, tick, side="right"))
    np.maximum.at(place, reports.pixel[:n], np.arange(n))  # in the order of time
    return place.reshape(reports.shape)


def intensity_image(reports: Intensities, tick: int) -> Values:
    """Last value that each pixel has reported up to the end of a tick, electrons a second, (H, W)
    float64; NaN if there is none.

    Raises ValueError for a tick outside the stream.
    """
    place = last_reports(reports, tick)
    image = np.full(reports.shape, np.nan)
    image[place >= 0] = reports.value[place[place >= 0]]
    return image
