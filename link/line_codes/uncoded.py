"""No line code: the bits of a byte unchanged.

All data are scrambled (link/coding/blocks.py), so that runs are those of random bits. `none` is the
form of earlier recordings, whose training is not random (link/layout.py).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from link.line_codes.code import LineCode


def _read(
    soft: npt.NDArray[np.float32],
    values: npt.NDArray[np.uint8],
    margins: npt.NDArray[np.float32],
) -> None:
    """Decides every bit separately; the margin is that of the weakest bit."""
    bits = soft.reshape(len(values), 8, -1)
    values[:] = np.packbits(bits > 0, axis=1, bitorder="little")[:, 0]
    margins[:] = np.nan_to_num(np.abs(bits), nan=0.0, posinf=1e6).min(axis=1)


UNCODED: Final = LineCode(
    "none", symbols=8, bits=8, run_limit=None, codewords=np.arange(256, dtype=np.uint16)[None],
    read=_read,
)  # fmt: skip
SCRAMBLED: Final = replace(UNCODED, name="scrambled")
