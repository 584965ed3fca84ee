"""What a burst must contain, of registers that stand still: whole frames at once, in numpy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rtl_model.cycle.pixel import increments, step
from rtl_model.geometry import Geometry
from rtl_model.registers import quantum

__all__ = ["Settings", "planes"]


class Settings(NamedTuple):
    """Registers of the sensor while a burst is taken, named as they are. `rows` and `columns` are
    (first, last), last inclusive; None is all. `first_frame` is the number of the first frame."""

    threshold: int = 7
    clock_select: int = 0
    reset_rule: int = 0
    rows: tuple[int, int] | None = None
    columns: tuple[int, int] | None = None
    pattern: int = 0
    level: int = 0
    first_frame: int = 0


def planes(
    geometry: Geometry,
    settings: Settings,
    pattern: npt.ArrayLike | None,
    frames: int,
    charge: npt.NDArray[np.int64] | None = None,
) -> npt.NDArray[np.bool_]:
    """Returns the spikes of `frames` frames, (frames, rows, columns) bool; pixels outside the
    window never fire.

    pattern: (rows, columns) electrons in a 40 kHz tick, 0 to 255, of the pattern memory; None is
        none at all.
    charge: (rows, columns) int64 before the first frame, changed in place to that after the last;
        None is the empty array that follows a clear.
    """
    shape = (geometry.rows, geometry.columns)
    memory = np.zeros(shape, np.int64) if pattern is None else np.asarray(pattern, np.int64)
    if charge is None:
        charge = np.zeros(shape, np.int64)
    row, column = np.ogrid[: shape[0], : shape[1]]
    top, bottom = settings.rows or (0, shape[0] - 1)
    left, right = settings.columns or (0, shape[1] - 1)
    inside = (row >= top) & (row <= bottom) & (column >= left) & (column <= right)
    q = quantum(settings.threshold)
    spikes = np.zeros((frames, *shape), bool)
    for n in range(frames):
        frame = settings.first_frame + n
        electrons = increments(settings.pattern, settings.level, frame, row, column, memory)
        rest, fired = step(charge, electrons << settings.clock_select, q, settings.reset_rule)
        charge[...] = np.where(inside, rest, 0)
        spikes[n] = fired & inside
    return spikes
