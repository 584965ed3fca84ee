"""Passes over soft values: scale and decisions, how sure the cells are, how many are wrong.

1 / (1 + e^a) is e / (1 + e) with e = e^-a, and e^-a is 2^-k p(r) with a = k ln 2 + r and p the
Taylor polynomial of e^-r: abs r is at most ln 2 / 2, so that six terms leave 2e-7. The powers of
two are made from their exponents' bits, in arrays, so that all loops are vectors.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.cores import by_rows

_CELLS: Final = 2048
"""Cells whose chances are added up together."""
_FAR: Final = np.float32(80.0)
"""Magnitude from which a wrong decision is not expected; its power of two is a normal number."""
_LOG2E, _HIGH, _LOW = np.float32(1 / np.log(2)), np.float32(0.693359375), np.float32(-2.12194440e-4)
"""_HIGH and _LOW: ln 2 in two parts (Cody and Waite 1980), whose multiples are exact."""
_ONE: Final = np.float32(1)
_T2, _T3, _T4, _T5, _T6 = (np.float32((-1) ** n / np.prod(range(1, n + 1))) for n in range(2, 7))
_BIAS, _FRACTION = np.int32(127), np.int32(23)
"""Parts of a float32: bias of the exponent, and bits of the fraction."""


@njit(cache=True, nogil=True)
def _powers(size, rest, power):  # type: ignore[no-untyped-def]
    """Fills the rest r and the bits of 2^-k of magnitudes, (n,) each."""
    for c in range(len(size)):
        value = min(size[c], _FAR)
        whole = np.rint(value * _LOG2E)
        rest[c] = (value - whole * _HIGH) - whole * _LOW
        power[c] = (_BIAS - np.int32(whole)) << _FRACTION


@njit(cache=True, nogil=True, error_model="numpy")  # a test of the divisor would be no vector
def _add_chances(rest, scale, total):  # type: ignore[no-untyped-def]
    """Adds the chances of magnitudes, from `_powers`, to total, (n,)."""
    for c in range(len(total)):
        r = rest[c]
        series = _T6 * r + _T5
        series = series * r + _T4
        series = series * r + _T3
        series = series * r + _T2
        e = ((series * r - _ONE) * r + _ONE) * scale[c]
        total[c] += e / (_ONE + e)


@njit(cache=True, nogil=True)
def _add_sizes(soft, size, quality):  # type: ignore[no-untyped-def]
    """Fills the magnitudes of soft values, and adds them to quality, (n,) each."""
    for c in range(len(soft)):
        size[c] = abs(soft[c])
        quality[c] += size[c]


@njit(cache=True, nogil=True)
def _decide(soft, factor, decided):  # type: ignore[no-untyped-def]
    for c in range(len(soft)):
        soft[c] *= factor
        decided[c] = soft[c] > 0


@njit(cache=True, nogil=True)
def _decide_all(n0, n1, soft, factor, decided):  # type: ignore[no-untyped-def]
    for n in range(n0, n1):
        _decide(soft[n], factor, decided[n])


@njit(cache=True, nogil=True)
def _tally(part0, part1, soft, quality, wrong):  # type: ignore[no-untyped-def]
    cells = soft.shape[1]
    for part in range(part0, part1):
        low, high = part * _CELLS, min((part + 1) * _CELLS, cells)
        size, rest = np.empty(high - low, np.float32), np.empty(high - low, np.float32)
        total, power = np.zeros(high - low, np.float32), np.empty(high - low, np.int32)
        for n in range(len(soft)):
            _add_sizes(soft[n, low:high], size, quality[low:high])
            _powers(size, rest, power)
            _add_chances(rest, power.view(np.float32), total)
        wrong[part] = np.sum(total.astype(np.float64))


def decide(soft: npt.NDArray[np.float32], factor: float) -> npt.NDArray[np.bool_]:
    """Multiplies soft values, (symbols, cells), by a factor in place. Returns the bits, of the same
    shape."""
    decided = np.empty(soft.shape, np.bool_)
    by_rows(_decide_all, len(soft), soft, np.float32(factor), decided)
    return decided


def tally(soft: npt.NDArray[np.float32], quality: npt.NDArray[np.float64]) -> float:
    """Adds the magnitudes of soft values to those of their cells, in place.

    Args:
        soft: (symbols, cells) float32, without NaN.
        quality: (cells,) float64.

    Returns:
        The sum of 1 / (1 + e^abs(soft)): wrong decisions that the soft values predict.
    """
    wrong = np.zeros(-(-soft.shape[1] // _CELLS))
    by_rows(_tally, wrong.size, np.ascontiguousarray(soft), quality, wrong)
    return float(wrong.sum())
