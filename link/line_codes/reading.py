"""Maximum-likelihood decoding of line codes, compiled.

Symbols are independent, so the log likelihood of a codeword is, up to a constant, the sum of the
soft values over the symbols in which it is on. The margin is the score of the best codeword minus
that of the best codeword of any other value. No branch depends on soft values: on noise, branch
prediction would fail half of the time.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from link.line_codes.eight_ten_parts import FOUR, MIDDLE, SIX

_MOST = np.float32(1e4)
"""Soft values are clipped to it, so that sums stay finite and accurate."""
_LEAST = np.float32(-1e9)
"""Less than any sum."""


@njit(cache=True, nogil=True, inline="always")
def _sums(soft, first, cell, bits, sums):  # type: ignore[no-untyped-def]
    """Sums of soft values over each subset of `bits` symbols from `first` on; NaN counts as 0."""
    sums[0] = np.float32(0)
    for k in range(bits):
        value = soft[first + k, cell]
        value = value if value > -_MOST else (-_MOST if value <= -_MOST else np.float32(0))
        value = value if value < _MOST else _MOST
        for mask in range(1 << k):
            sums[mask | (1 << k)] = sums[mask] + value


@njit(cache=True, nogil=True)
def read_table(soft, codes, bits, values, margins):  # type: ignore[no-untyped-def]
    """Decodes a code of one state.

    Args:
        soft: (groups * bits, cells) float32.
        codes: (values,) uint16, the codeword of each value.
        bits: symbols of a codeword.
        values, margins: (groups, cells) uint8 and float32, filled.
    """
    sums = np.empty(1 << bits, np.float32)
    for group in range(values.shape[0]):
        for cell in range(values.shape[1]):
            _sums(soft, group * bits, cell, bits, sums)
            best = second = _LEAST
            at = 0
            for value in range(len(codes)):
                score = sums[codes[value]]
                beaten = score if score < best else best
                second = beaten if beaten > second else second
                at = value if score > best else at
                best = score if score > best else best
            values[group, cell] = at
            margins[group, cell] = best - second


@njit(cache=True, nogil=True)
def read_8b10b(soft, values, margins):  # type: ignore[no-untyped-def]
    """Decodes 8B10B with either running disparity at the start of each group.

    Args:
        soft: (groups * 10, cells) float32.
        values, margins: (groups, cells) uint8 and float32, filled.
    """
    six, four = np.empty(64, np.float32), np.empty(16, np.float32)
    tops, nexts, tops_at = np.empty(4, np.float32), np.empty(4, np.float32), np.empty(4, np.int64)
    bests, seconds = np.empty(2, np.float32), np.empty(2, np.float32)
    at = np.empty(2, np.int64)
    for group in range(values.shape[0]):
        for cell in range(values.shape[1]):
            _sums(soft, group * 10, cell, 6, six)
            _sums(soft, group * 10 + 6, cell, 4, four)
            for row in range(4):  # the two best HGF
                best = second = _LEAST
                y_best = 0
                for y in range(8):
                    score = four[FOUR[row, y]]
                    beaten = score if score < best else best
                    second = beaten if beaten > second else second
                    y_best = y if score > best else y_best
                    best = score if score > best else best
                tops[row], nexts[row], tops_at[row] = best, second, y_best << 5
            for disparity in range(2):  # codewords of one disparity have different values
                best = second = _LEAST
                value = 0
                for x in range(32):
                    row = MIDDLE[disparity, x]
                    part = six[SIX[disparity, x]]
                    score = part + tops[row]
                    other = part + nexts[row]
                    beaten = score if score < best else best
                    beaten = other if other > beaten else beaten
                    second = beaten if beaten > second else second
                    value = x | tops_at[row] if score > best else value
                    best = score if score > best else best
                bests[disparity], seconds[disparity], at[disparity] = best, second, value
            won = 1 if bests[1] > bests[0] else 0
            rival = seconds[1 - won] if at[0] == at[1] else bests[1 - won]
            values[group, cell] = at[won]
            margins[group, cell] = bests[won] - max(rival, seconds[won])
