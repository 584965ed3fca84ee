"""Dim pixels of an image (Huang 2022, 4.4 and 4.5): readings below threshold, and the dark.

A pixel without a spike between two readings has gathered the difference of their levels: m levels
of N in T cycles are m / (N T) spikes a cycle. One level is the least light, so that from one spike
a cycle down the range is 20 lg(T N) dB. As both readings round down and the first has any phase
within a level, the difference has no offset.

An interval of Q / I_dark or more is what dark current alone would take, so its spike is noise, and
the pixel is dark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.archive import load_arrays
from cosim.errors import InputError
from cosim.files.atomic import atomic_write
from cosim.spikes.viform import SpikeStream, count_spikes
from sensor.reconstruct.intervals import least_width

READINGS = "readings.npz"
"""Readings in the folder of a run."""
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of the stored charge of all pixels.

    Attributes:
        cycle: (n,) int64, ascending: a reading follows so many cycles. The first is 0.
        level: (n, H, W) uint16, floor(levels charge / threshold).
        levels: N, levels of a threshold.
    """

    cycle: npt.NDArray[np.int64]
    level: npt.NDArray[np.uint16]
    levels: int

    @property
    def every(self) -> int:
        """Cycles between two readings at whole multiples of them; 0 for fewer than two, or for
        others."""
        every = int(self.cycle[1]) if self.cycle.size > 1 else 0
        return every if np.array_equal(self.cycle, np.arange(self.cycle.size) * every) else 0

    def gain(self, number: int) -> npt.NDArray[np.int64]:
        """Levels from reading `number` - 1 to reading `number`, (H, W), 0 or more: those of a pixel
        that has not fired between them; none after the last reading."""
        if number >= self.cycle.size:
            return np.zeros(self.level.shape[1:], np.int64)
        return np.maximum(self.level[number].astype(np.int64) - self.level[number - 1], 0)

    def rate(self, stream: SpikeStream, at: int) -> tuple[Mask, npt.NDArray[np.float32]]:
        """Pixels without a spike between the readings around cycle `at`, (H, W), and their light in
        spikes a cycle, 0 elsewhere. No pixel if a reading before or after the cycle is missing."""
        after = int(np.searchsorted(self.cycle, at, side="right"))
        if not 0 < after < self.cycle.size:
            return np.zeros(stream.shape, bool), np.zeros(stream.shape, np.float32)
        first, stop = int(self.cycle[after - 1]), int(self.cycle[after])
        read = count_spikes(stream, first, stop) == 0
        more = self.level[after].astype(np.int64) - self.level[after - 1]
        light = np.maximum(more, 0) / (self.levels * (stop - first))
        return read, np.where(read, light, 0).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Dim:
    """Dim pixels at one instant.

    Attributes:
        read: pixels whose light is from a reading, (H, W).
        rate: rate of the light, spikes a cycle, 0 elsewhere, (H, W).
        dark: pixels that are rejected as dark, (H, W).
    """

    read: Mask
    rate: npt.NDArray[np.float32]
    dark: Mask

    def put(self, rate: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """An image in spikes a cycle with the readings in it, and without the dark."""
        return np.where(self.dark, np.float32(0), np.where(self.read, self.rate, rate))


@dataclass(frozen=True, eq=False)
class DimLight:
    """How dim pixels are imaged.

    Attributes:
        readings: readings below threshold, None for none.
        dark: width in cycles from which on an interval is dark current's; infinite for none.
    """

    readings: Readings | None = None
    dark: float = math.inf

    def at(self, stream: SpikeStream, at: int) -> Dim:
        """Dim pixels at cycle `at`."""
        read, rate = np.zeros(stream.shape, bool), np.zeros(stream.shape, np.float32)
        if self.readings is not None:
            read, rate = self.readings.rate(stream, at)
        dark = np.zeros(stream.shape, bool)
        if math.isfinite(self.dark):
            dark = np.where(read, rate * self.dark <= 1, least_width(stream, at) >= self.dark)
        return Dim(read, rate, dark)


def quantised(electrons: npt.NDArray[Any], threshold: float, levels: int) -> npt.NDArray[np.uint16]:
    """Level of a charge, floor(levels electrons / threshold), from 0 to `levels`."""
    level = np.floor(electrons * (levels / threshold))
    return np.clip(level, 0, levels).astype(np.uint16)


def write_readings(readings: Readings, path: Path) -> None:
    """Writes readings as `.npz`: arrays `cycle`, `level` and `levels`."""
    with atomic_write(path) as part, part.open("wb") as file:
        np.savez_compressed(
            file, cycle=readings.cycle, level=readings.level, levels=np.int64(readings.levels)
        )


def read_readings(path: Path) -> Readings:
    """Readings from a file of `write_readings`. Raises InputError for any other file."""
    try:
        arrays = load_arrays(path)
        cycle, level, levels = arrays["cycle"], arrays["level"], int(arrays["levels"][()])
        fits = cycle.ndim == 1 and level.ndim == 3 and len(level) == cycle.size and levels > 0
        if not fits or (np.diff(cycle) <= 0).any():
            raise ValueError("arrays that do not belong together")
    except (OSError, ValueError, KeyError, TypeError) as exc:
        raise InputError(
            f"{path}", "readings of a run, with `cycle`, `level` and `levels`", str(exc),
            f"give the {READINGS} of its folder",
        ) from exc  # fmt: skip
    return Readings(cycle.astype(np.int64), level, levels)
