"""The board's pixel, bit-true, in numpy: what the pattern gives it and what a tick makes of it."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["CHARGE_MAX", "Pattern", "ResetRule", "increments", "step"]

CHARGE_MAX = 4095
"""Charge is kept in 12 bits and saturates."""

Ints = npt.NDArray[np.int64]


class ResetRule(IntEnum):
    """What a spike leaves of the charge."""

    RESIDUAL = 0
    HARD = 1
    SUBTRACT = 2
    RESERVED = 3


class Pattern(IntEnum):
    """Where a pixel's electrons of a tick come from."""

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
    """Returns electrons of a 40 kHz tick, 0 to 255, of pixels at (row, column), all broadcast
    together; memory: their bytes of the pattern memory."""
    row, column = np.asarray(row, np.int64), np.asarray(column, np.int64)
    if pattern == Pattern.MEMORY:
        made = np.asarray(memory, np.int64) + 0 * (row + column)
    elif pattern == Pattern.CONSTANT:
        made = level + 0 * (row + column)
    elif pattern == Pattern.RAMP:
        made = (level + row + column + frame) & 255
    else:
        made = ((row ^ column ^ frame) & 1) * level
    return made.astype(np.int64)


def step(charge: Ints, electrons: Ints, q: int, rule: int) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """Adds `electrons` to `charge` and compares with `q` once: (charge left, spikes)."""
    total = charge + electrons
    fired = total >= q
    if rule == ResetRule.HARD:
        rest = np.where(fired, 0, total)
    elif rule == ResetRule.SUBTRACT:
        rest = np.where(fired, total - q, total)
    else:
        rest = total - q * ((total >= q).astype(np.int64) + (total >= 2 * q))
    return np.minimum(rest, CHARGE_MAX), fired
