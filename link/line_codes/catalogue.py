"""All line codes, by name."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.line_codes.code import Bits, LineCode
from link.line_codes.eight_ten import EIGHT_TEN
from link.line_codes.four_six import FOUR_SIX
from link.line_codes.manchester import MANCHESTER
from link.line_codes.uncoded import SCRAMBLED, UNCODED

CATALOGUE: Final[dict[str, LineCode]] = {
    code.name: code for code in (UNCODED, MANCHESTER, FOUR_SIX, EIGHT_TEN, SCRAMBLED)
}
"""Line codes in the order of their numbers in the tags of a panel, so a new code goes to the
end."""


def encode_line(line: str, values: npt.NDArray[np.uint8], disparity: Bits | None = None) -> Bits:
    """Symbols of the cells in the code of this name; see `LineCode.encode`."""
    return CATALOGUE[line].encode(values, disparity)


def decode_line(
    line: str, soft: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Most likely values in the code of this name; see `LineCode.decode`."""
    return CATALOGUE[line].decode(soft)
