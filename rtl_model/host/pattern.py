"""Upload of the pattern memory: the electrons of each pixel in a tick."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.host.board import Board
from rtl_model.host.faults import Cause, LineFault

_REPEATS = 3  # of a block, which may be written again without effect
_RECOVERABLE = (Cause.SHORT, Cause.GARBLED)


def upload(board: Board, image: npt.ArrayLike, *, readback: bool = True) -> int:
    """Writes an image into the pattern memory; returns the number of repeated blocks.

    The words are checked by the board's count and CRC-32.

    Args:
        board: a Viform board.
        image: electrons in a tick, (rows, columns), integers 0 to 255.
        readback: whether the words are read again, which also checks their addresses.

    Raises:
        InputError: for an image of another size or range.
        LineFault: if a block fails repeatedly.
    """
    info = board.info()
    pixels = np.asarray(image)
    if pixels.shape != (info.rows, info.columns):
        raise InputError(
            "the pattern",
            f"{info.rows} x {info.columns} pixels, as the board",
            " x ".join(map(str, pixels.shape)) or "a single value",
            "scale it",
        )
    if pixels.dtype.kind not in "uib" or pixels.min() < 0 or pixels.max() > 255:
        raise InputError("the pattern", "integers from 0 to 255", "others", "scale and round it")
    wide = 32 * info.geometry.row_words
    padded = np.zeros((info.rows, wide), np.uint8)
    padded[:, : info.columns] = pixels
    words = [int(word) for word in np.ascontiguousarray(padded).view("<u4").reshape(-1)]
    base = board.csr.base("pattern_mem")
    size = board.bone.words_at_once
    repeated = 0
    for start in range(0, len(words), size):
        block = words[start : start + size]
        for left in reversed(range(_REPEATS + 1)):
            try:
                board.verified_write(base + 4 * start, block, readback=readback)
                break
            except LineFault as fault:
                if not left or fault.cause not in _RECOVERABLE:
                    raise
                repeated += 1
                board.bone.resynchronise()
    return repeated
