"""4B6B: IEEE 802.15.7-2011, table 103."""

from __future__ import annotations

from typing import Final

import numpy as np

from link.line_codes.code import LineCode

_WORDS: Final = (
    "001110 001101 010011 010110 010101 100011 100110 100101 "
    "011001 011010 011100 110001 110010 101001 101010 101100"
)
"""Codewords of 0 to 15; the symbol that is sent first is on the left."""

FOUR_SIX: Final = LineCode(
    "4b6b", symbols=6, bits=4, run_limit=4,
    codewords=np.array([[int(word[::-1], 2) for word in _WORDS.split()]], np.uint16),
)  # fmt: skip
