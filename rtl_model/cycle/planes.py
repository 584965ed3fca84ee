"""Expected planes of a burst with constant registers, in numpy, one frame at a time, by the board's
pixel, bit-exact: electrons of the pattern, and one tick.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rtl_model.geometry import Geometry
from rtl_model.registers import quantum

Ints = npt.NDArray[np.int64]
CHARGE_MAX = 4095
"""Largest charge: 12 bits, saturating."""


class Settings(NamedTuple):
    """Registers of the sensor during a burst.

    Attributes:
        threshold, clock_select, reset_rule, pattern, level: registers `sensor_*` of that name.
        rows, columns: (first, last) of the window, last inclusive; None for all.
        first_frame: number of the first frame.
    """

    threshold: int = 7
    clock_select: int = 0
    reset_rule: int = 0
    rows: tuple[int, int] | None = None
    columns: tuple[int, int] | None = None
    pattern: int = 0
    level: int = 0
    first_frame: int = 0

    @classmethod
    def from_registers(cls, registers: Mapping[str, int], first_frame: int = 0) -> Settings:
        """Derives the settings from the values of all `sensor_*` registers."""
        rows, columns = registers["sensor_rows"], registers["sensor_columns"]
        return cls(
            threshold=registers["sensor_threshold"],
            clock_select=registers["sensor_clock_select"],
            reset_rule=registers["sensor_reset_rule"],
            rows=(rows & 0xFFFF, rows >> 16),
            columns=(columns & 0xFFFF, columns >> 16),
            pattern=registers["sensor_pattern"],
            level=registers["sensor_level"],
            first_frame=first_frame,
        )


def planes(
    geometry: Geometry,
    settings: Settings,
    pattern: npt.ArrayLike | None,
    frames: int,
    charge: npt.NDArray[np.int64] | None = None,
) -> npt.NDArray[np.bool_]:
    """Computes the spikes of `frames` frames, (frames, rows, columns) bool.

    Pixels outside the window never fire.

    Args:
        geometry: size of the array.
        settings: registers of the sensor.
        pattern: contents of the pattern memory, (rows, columns), electrons in a 40 kHz tick, 0 to
            255; None for zeros.
        frames: number of frames.
        charge: (rows, columns) int64 before the first frame, updated in place to that after the
            last; None for no charge, as after a clear.
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


class ResetRule(IntEnum):
    """Charge after a spike."""

    RESIDUAL = 0
    HARD = 1
    SUBTRACT = 2
    RESERVED = 3


class Pattern(IntEnum):
    """Source of a pixel's electrons."""

    MEMORY = 0
    CONSTANT = 1
    RAMP = 2
    CHECKER = 3


def increments(
    pattern: int,
    level: int,
    frame: int,
    row: npt.NDArray[Any],
    column: npt.NDArray[Any],
    memory: npt.NDArray[Any],
) -> Ints:
    """Electrons in a 40 kHz tick, 0 to 255, int64.

    Args:
        pattern, level: registers `sensor_pattern` and `sensor_level`.
        frame: number since the clear.
        row, column: rows and columns of the pixels; they are broadcast.
        memory: bytes of the pattern memory of these pixels.
    """
    row, column = np.asarray(row, np.int64), np.asarray(column, np.int64)
    if pattern == Pattern.MEMORY:
        electrons = np.asarray(memory, np.int64) + 0 * (row + column)
    elif pattern == Pattern.CONSTANT:
        electrons = level + 0 * (row + column)
    elif pattern == Pattern.RAMP:
        electrons = (level + row + column + frame) & 255
    else:
        electrons = ((row ^ column ^ frame) & 1) * level
    return electrons.astype(np.int64)


def step(charge: Ints, electrons: Ints, q: int, rule: int) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """Adds the electrons of a tick to the charge and compares it with the threshold.

    Args:
        charge, electrons: int64, of any common shape.
        q: threshold, electrons.
        rule: a `ResetRule`.

    Returns:
        The charge after the tick, int64, and the spikes, bool.
    """
    total = charge + electrons
    fired = total >= q
    if rule == ResetRule.HARD:
        rest = np.where(fired, 0, total)
    elif rule == ResetRule.SUBTRACT:
        rest = np.where(fired, total - q, total)
    else:
        rest = total - q * ((total >= q).astype(np.int64) + (total >= 2 * q))
    return np.minimum(rest, CHARGE_MAX), fired
