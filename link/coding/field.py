"""The field of 256 elements of the Reed-Solomon codes of CCSDS 131.0-B.

The polynomial is x^8 + x^7 + x^2 + x + 1 (0x187). Elements are written as powers of alpha^11, alpha
= 2, which the standard's generator is built from; it is primitive, because 11 and 255 have no
common factor. Bytes are in the conventional basis, not in Berlekamp's dual basis.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

_POLYNOMIAL: Final = 0x187
_STEP: Final = 11


def _powers() -> npt.NDArray[np.uint8]:
    alpha = [1]
    for _ in range(254):
        twice = alpha[-1] << 1
        alpha.append(twice ^ _POLYNOMIAL if twice > 255 else twice)
    # Two periods, so that the sum of two logarithms is a valid index.
    return np.array([alpha[_STEP * i % 255] for i in range(510)], np.uint8)


EXP: Final = _powers()
"""(510,) uint8: powers of alpha^11."""
LOG: Final = np.zeros(256, np.int32)
"""(256,) int32: their exponents; the entry of 0 is undefined."""
LOG[EXP[:255]] = np.arange(255)
PRODUCT: Final = np.where(
    (np.arange(256)[:, None] > 0) & (np.arange(256) > 0), EXP[LOG[:, None] + LOG], 0
).astype(np.uint8)
"""(256, 256) uint8: products."""
