"""The state of the monitors, and the reports of one call of a kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

CHUNK = 256
"""Pixels whose reports share one buffer, and one task of a processor core."""

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Monitors:
    """One value per pixel.

    Attributes:
        current: filtered photocurrent, electrons/s.
        reference: value of the last report, NaN before the first.
        when: instant from which the comparator is active, or at which the running measurement began
            (without noise: picoseconds) or ends (sampled: tick).
        measuring: 1 during a measurement.
        charge: charge of the measurement so far, electrons.
    """

    current: Floats
    reference: Floats
    when: Ints
    measuring: npt.NDArray[np.uint8]
    charge: Floats

    @classmethod
    def fresh(cls, current: Floats, when: int) -> Monitors:
        """Before the first report."""
        n = current.size
        return cls(
            current.copy(), np.full(n, np.nan), np.full(n, when, np.int64), np.zeros(n, np.uint8),
            np.zeros(n),
        )  # fmt: skip

    def copy(self) -> Monitors:
        return Monitors(*(getattr(self, f.name).copy() for f in fields(self)))


@dataclass(frozen=True, eq=False)
class Reports:
    """Reports in no particular order, each array (n,).

    Attributes:
        pixel: place in the plane.
        tick: tick of the report.
        value: photocurrent before the converter, electrons/s.
    """

    pixel: Ints
    tick: Ints
    value: Floats


Kernel = Callable[[Monitors, Ints, Ints, Ints, Floats], None]
"""(monitors, changed in place; counts (chunks,); pixel, tick, value (chunks, room)). Counts all
reports of a chunk, writes those there is room for."""


def collect(kernel: Kernel, monitors: Monitors, room: int) -> tuple[Monitors, Reports, int]:
    """Monitors after the kernel, their reports, and the room that was needed. Where a chunk had
    more reports than room, all is done again with enough."""
    chunks = -(-monitors.current.size // CHUNK)
    while True:
        after, counts = monitors.copy(), np.zeros(chunks, np.int64)
        pixel, tick = (np.empty((chunks, room), np.int64) for _ in range(2))
        value = np.empty((chunks, room))
        kernel(after, counts, pixel, tick, value)
        most = int(counts.max())
        if most <= room:
            there = np.arange(room) < counts[:, None]
            return after, Reports(pixel[there], tick[there], value[there]), room
        room = 1 << (most - 1).bit_length()
