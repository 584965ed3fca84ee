"""The board's pixel in numpy, bit-exact: electrons of the pattern, and one tick."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

CHARGE_MAX = 4095
"""Largest charge: 12 bits, saturating."""

Ints = npt.NDArray[np.int64]


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
