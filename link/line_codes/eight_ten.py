"""8B10B: Widmer and Franaszek, IBM J. Res. Dev. 27:440 (1983), tables 1 and 2.

A byte HGFEDCBA is coded by 5B/6B on EDCBA and 3B/4B on HGF; bits are sent in the order a b c d e i
f g h j. The running disparity continues from group to group. The compiled reader is imported on
first use, as in `link.line_codes.code`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.line_codes.code import LineCode
from link.line_codes.eight_ten_parts import FOUR, MIDDLE, SIX


def _codewords() -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.bool_]]:
    """Codewords by running disparity and byte, (2, 256), and the bytes that change the
    disparity."""
    value = np.arange(256)
    x, y = value & 31, value >> 5
    codes = np.stack(
        [SIX[d, x].astype(np.uint16) | FOUR[MIDDLE[d, x], y].astype(np.uint16) << 6 for d in (0, 1)]
    )
    return codes, np.bitwise_count(codes[0]) != 5


def _read(
    soft: npt.NDArray[np.float32],
    values: npt.NDArray[np.uint8],
    margins: npt.NDArray[np.float32],
) -> None:
    from link.line_codes.reading import read_8b10b

    read_8b10b(soft, values, margins)


_CODEWORDS, _TOGGLES = _codewords()

EIGHT_TEN: Final = LineCode(
    "8b10b", symbols=10, bits=8, run_limit=5, codewords=_CODEWORDS, toggles=_TOGGLES, read=_read
)
