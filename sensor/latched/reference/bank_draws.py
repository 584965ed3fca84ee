"""Draws from the bank of thresholds (sensor/latched/pixel/bank.py) in compiled loops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from sensor.latched.fast.units import units_of
from sensor.latched.pixel.bank import (
    GENERATOR,
    LANES,
    STEPS,
    bank_of,
    group_keys,
    groups_of,
    has_bank,
    offsets,
)
from sensor.latched.pixel.model import ExactModel

Values = npt.NDArray[np.float64]

_WEYL = np.uint64(GENERATOR["WEYL"])
_FACTORS = np.array([GENERATOR["FACTOR_1"], GENERATOR["FACTOR_2"]], np.uint64)
_SHIFTS = np.array([GENERATOR["SHIFT_1"], GENERATOR["SHIFT_2"]], np.uint64)
_REPEAT = np.uint64(GENERATOR["PERIOD"] - 1)
_LOW = np.uint64(0xFFFFFFFF)
_SIZE = np.uint64((1 << GENERATOR["BANK_BITS"]) - 1)
_TOP = np.uint64(32 - GENERATOR["BANK_BITS"])


@njit(cache=True, error_model="numpy", nogil=True)
def _scrambled(word):  # type: ignore[no-untyped-def]
    word = ((word ^ (word >> _SHIFTS[0])) * _FACTORS[0]) & _LOW
    word = ((word ^ (word >> _SHIFTS[1])) * _FACTORS[1]) & _LOW
    return word ^ (word >> np.uint64(16))


@njit(cache=True, error_model="numpy", nogil=True)
def bank_entry(key, lane, cycle, crossing):  # type: ignore[no-untyped-def]
    """Place in the bank of the threshold that a pixel draws: the compiled form of `offsets`, plus
    the pixel's place in its group."""
    cycle = np.uint64(cycle) & _REPEAT
    state = _scrambled(np.uint64(key) ^ (((cycle >> np.uint64(5)) * _WEYL) & _LOW))
    at = np.int64(cycle & np.uint64(31))
    state = (np.uint64(STEPS[0, at]) * state + np.uint64(STEPS[1, at])) & _LOW
    if crossing > 1:
        state = _scrambled((state + np.uint64(crossing)) & _LOW)
    if crossing == 1:
        return np.int64((state >> np.uint64(8)) & _SIZE) + lane
    return np.int64(state >> _TOP) + lane


@dataclass(frozen=True, eq=False)
class BankDraws:
    """What pixels draw from the bank, in the form that compiled loops take.

    Attributes:
        values: thresholds in electrons, with the first lanes once more after the last.
        groups: (n,) uint32, number of the first pixel of each pixel's group.
        keys: (n,) uint32, hash of that group.
        lanes: (n,) int64, place of each pixel in its group; -1 for a pixel that draws its own
            thresholds.
    """

    values: Values
    groups: npt.NDArray[np.uint32]
    keys: npt.NDArray[np.uint32]
    lanes: npt.NDArray[np.int64]

    @property
    def mine(self) -> npt.NDArray[np.bool_]:
        """(n,) the pixels that draw from the bank."""
        return self.lanes >= 0

    def draw(self, model: ExactModel, mine: npt.NDArray[Any], cycles: Any, crossing: int) -> Values:
        """Thresholds that pixels draw in a cycle, (n,) electrons; see `Bank.draw`. mine: places of
        the n pixels."""
        at = offsets(self.groups[mine], cycles, crossing, model.seed)
        return np.asarray(self.values[at + self.lanes[mine]])


def bank_draws(
    model: ExactModel,
    numbers: npt.NDArray[np.uint32],
    shape: tuple[int, int] | None = None,
    groups: npt.NDArray[np.bool_] | None = None,
) -> BankDraws:
    """Draws of the pixels of a plane.

    Args:
        model: rules of a pixel.
        numbers: (H W,) numbers of the pixels on the chip.
        shape: (H, W); None if no pixel draws from the bank.
        groups: (H, groups) bool, groups of sixteen columns that draw from the bank; None for none.
    """
    n = numbers.size
    if shape is None or groups is None or not groups.any() or not has_bank(model):
        nothing = np.zeros(n, np.uint32)
        return BankDraws(np.zeros(1), nothing, nothing, np.full(n, -1, np.int64))
    first, lanes = groups_of(numbers, shape)
    mine = np.repeat(groups, LANES, axis=1)[:, : shape[1]].ravel()
    bits = units_of(model).bits
    values = bank_of(model, bits).values.astype(np.float64) * (model.mean / 2.0**bits)
    keys = group_keys(first, model.seed)
    return BankDraws(values, first, keys, np.where(mine, lanes.astype(np.int64), -1))
