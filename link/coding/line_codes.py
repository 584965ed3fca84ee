"""Line codes: what each cell shows along time, and what soft values say it was.

Every cell is a lane of its own. Groups follow one another without gaps; 8B10B carries its running
disparity on from group to group. Bits go out lowest first.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from link.coding.line_compiled import read_8b10b, read_table
from link.coding.line_tables import CODES_4B6B, CODES_8B10B, FLIPS_8B10B
from link.layout import GROUP_BITS, GROUP_SYMBOLS
from link.mode import LineCode

__all__ = ["decode_line", "encode_line", "run_limit"]

_Bits = npt.NDArray[np.bool_]

_TABLES = {
    "none": np.arange(256, dtype=np.uint16),
    "manchester": np.array([0b10, 0b01], np.uint16),
    "4b6b": CODES_4B6B.astype(np.uint16),
}
"""Codes that know no state, one for each value."""


@cache
def run_limit(line: LineCode) -> int | None:
    """Longest run of equal symbols that the code makes; None where data may make any."""
    return {"none": None, "manchester": 2, "4b6b": 4, "8b10b": 5}[line]


def encode_line(
    line: LineCode, values: npt.NDArray[np.uint8], disparity: _Bits | None = None
) -> _Bits:
    """What the cells show: (groups * GROUP_SYMBOLS, cells) bool.

    values: (groups, cells) uint8, below 2^GROUP_BITS. disparity: (cells,) bool, of 8B10B, where the
    running disparity before the first group is positive; it is changed to that after the last.
    None: negative, as at a transmission's first group.
    """
    groups, cells = values.shape
    symbols = GROUP_SYMBOLS[line]
    if values.size and int(values.max()) >> GROUP_BITS[line]:
        raise ValueError(f"values of {line} must be below {1 << GROUP_BITS[line]}")
    state = np.zeros(cells, np.bool_) if disparity is None else disparity
    out = np.empty((groups, symbols, cells), np.bool_)
    for group, value in enumerate(values):
        if line == "8b10b":
            codes = np.where(state, CODES_8B10B[1][value], CODES_8B10B[0][value])
            state ^= FLIPS_8B10B[value]
        else:
            codes = _TABLES[line][value]
        for k in range(symbols):
            out[group, k] = codes & np.uint16(1 << k)
    return out.reshape(groups * symbols, cells)


def decode_line(
    line: LineCode, soft: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """The likeliest values, (groups, cells) uint8, and the decisions' margins, float32, nats: the
    logarithm of the odds against the likeliest other value; 0 is a guess.

    soft: (groups * GROUP_SYMBOLS, cells) float32, ln P(on) - ln P(off) of each symbol; one that is
    no number says nothing. Groups are read on their own, 8B10B of either running disparity.
    """
    symbols = GROUP_SYMBOLS[line]
    if soft.ndim != 2 or len(soft) % symbols:
        raise ValueError(f"soft must be (groups * {symbols}, cells), not {soft.shape}")
    given = np.ascontiguousarray(soft, np.float32)
    shape = len(given) // symbols, given.shape[1]
    values, margins = np.empty(shape, np.uint8), np.empty(shape, np.float32)
    if line == "8b10b":
        read_8b10b(given, values, margins)
    elif line == "none":
        _read_plain(given, values, margins)
    else:
        read_table(given, _TABLES[line], symbols, values, margins)
    return values, margins


def _read_plain(
    soft: npt.NDArray[np.float32],
    values: npt.NDArray[np.uint8],
    margins: npt.NDArray[np.float32],
) -> None:
    """Bits as they are: the weakest is the margin."""
    bits = soft.reshape(len(values), 8, -1)
    values[:] = np.packbits(bits > 0, axis=1, bitorder="little")[:, 0]
    margins[:] = np.nan_to_num(np.abs(bits), nan=0.0, posinf=1e6).min(axis=1)
