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

# Codes of EDCBA = 0 to 31 at negative running disparity. At positive disparity unbalanced ones,
# and 7, are inverted.
_5B6B: Final = (
    "100111 011101 101101 110001 110101 101001 011001 111000 "
    "111001 100101 010101 110100 001101 101100 011100 010111 "
    "011011 100011 010011 110010 001011 101010 011010 111010 "
    "110011 100110 010110 110110 001110 101110 011110 101011"
)
# Codes of HGF = 0 to 7; at positive disparity unbalanced ones, and 3, are inverted.
_3B4B: Final = "1011 1001 0101 1100 1101 1010 0110 1110"
_ALTERNATE: Final = "0111"
"""Replaces 1110 where that would give a run of five with the preceding bits e i."""


def _either(text: str, inverted_too: str) -> tuple[int, int]:
    """A part's bits at negative and at positive running disparity."""
    unbalanced = 2 * text.count("1") != len(text)
    code = int(text[::-1], 2)  # the first symbol is the lowest bit
    inverted = code ^ ((1 << len(text)) - 1)
    return code, inverted if unbalanced or text == inverted_too else code


def _parts() -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    six, four = np.zeros((2, 32), np.uint8), np.zeros((4, 8), np.uint8)
    middle = np.zeros((2, 32), np.uint8)
    for x, text in enumerate(_5B6B.split()):
        six[:, x] = _either(text, "111000")
        for disparity in (0, 1):
            after = disparity ^ (2 * text.count("1") != 6)
            e_i = six[disparity, x] >> 4
            run = e_i == (3 if after == 0 else 0)
            middle[disparity, x] = 2 * after + run
    for y, text in enumerate(_3B4B.split()):
        plain = _either(text, "1100")
        other = _either(_ALTERNATE, "") if y == 7 else plain
        four[:, y] = plain[0], other[0], plain[1], other[1]
    return six, four, middle


SIX, FOUR, MIDDLE = _parts()
"""Parts of 8B10B. SIX (2, 32): symbols 0 to 5 of EDCBA, by running disparity (0 negative). MIDDLE
(2, 32): the row of FOUR that follows. FOUR (4, 8): symbols 6 to 9 of HGF; a row is twice the
running disparity, plus one where the alternate 7 must be used."""


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
