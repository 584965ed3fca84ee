"""Manchester: 0 is off then on, 1 is on then off (IEEE 802.15.7-2011)."""

from __future__ import annotations

from typing import Final

import numpy as np

from link.line_codes.code import LineCode

MANCHESTER: Final = LineCode(
    "manchester", symbols=2, bits=1, run_limit=2, codewords=np.array([[0b10, 0b01]], np.uint16)
)
