"""The two parts of 8B10B, 5B/6B and 3B/4B, by running disparity.

Widmer and Franaszek, IBM J. Res. Dev. 27:440 (1983), tables 1 and 2.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

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
