"""Layout of the panel in space and time: tags, pilots, data, training.

Tags are shown permanently in the corners. A few columns of cells are pilots: all of them show the
same known sequence, so that symbols can be counted and timed row by row wherever a recording
begins. Every other cell carries data. Symbols 0 to TRAINING of a transmission show a known pattern
in the data cells as well; from then on each cell carries its line code, in groups of `group`
symbols. After the last group the first symbols of the training are repeated, so that the last data
have the same surroundings as all others. Otherwise darkness would follow them, and the statistics
learned from symbols with neighbours would not apply to the tick shared with it, the light of
neighbouring cells and the carried charge. These closing symbols carry no data: a receiver does not
need them, and a recording without them can be read.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from link.mode import Mode

TRAINING: Final = 48
"""Symbols of known data before the first group."""
PERIOD: Final = 960
"""Period of the pilots' sequence, symbols: a multiple of every group."""
TAG_MODULES: Final = 10
"""Modules along a tag's side: 6 of bits, a black border, a white margin."""
_CLOSING: Final = 2
"""Ticks after the last group: the one shared with its last symbol, and one whole tick, which
distinguishes it from darkness."""
_SMALLEST, _SHARE = 4, 96
"""Size of a tag's module: at least _SMALLEST panel pixels, otherwise the panel's shorter side over
_SHARE."""
_FEWEST, _MOST, _PILOT = 2, 16, 32
"""Pilot columns of format 1: at least _FEWEST, at most _MOST, one for every _PILOT columns of
cells."""
_SPARSE: Final = 5
"""Pilot columns of format 2, at most; a small panel has as many as in format 1."""
_ALIKE: Final = 0.9
"""Share of a group's bits equal to the closing from which it is the closing; for data it is
half."""


@cache
def pilots() -> npt.NDArray[np.bool_]:
    """Pilots' bits over a period, (PERIOD,).

    A maximal-length sequence of x^10 + x^7 + 1 (Golomb, Shift Register Sequences, 1967), truncated
    from 1023.
    """
    state, out = 1, np.zeros(PERIOD, np.bool_)
    for n in range(PERIOD):
        out[n] = state & 1
        state = (state >> 1) | (((state ^ (state >> 3)) & 1) << 9)
    out.flags.writeable = False  # the cached array is shared
    return out


@lru_cache(maxsize=4)
def training(layout: Layout) -> npt.NDArray[np.bool_]:
    """Bits of the data cells before the first group, (TRAINING, cells).

    In format 1 they are random in even symbols and inverted in odd ones, so that every cell is on
    half of the time, as the line codes have it. In format 2 all of them are random: charge that a
    pixel carries into the next symbol then has the same distribution as in scrambled data.
    """
    rng = np.random.Generator(np.random.Philox(key=0x5649464F524D))
    drawn = TRAINING // (2 if layout.mode.format == 1 else 1)
    bits = rng.integers(0, 2, (drawn, layout.cells), dtype=np.uint8).astype(np.bool_)
    if layout.mode.format == 1:
        bits = np.stack([bits, ~bits], axis=1).reshape(TRAINING, layout.cells)
    bits.flags.writeable = False  # the cached array is shared
    return bits


def closing(layout: Layout) -> npt.NDArray[np.bool_]:
    """Bits of the data cells after the last group, (`Layout.closing`, cells)."""
    return training(layout)[: layout.closing]


def is_closing(layout: Layout, group: npt.NDArray[np.bool_]) -> bool:
    """Whether the bits of a group, (symbols, cells), are the beginning of the closing.

    With short groups the closing is almost as long as a group.
    """
    known = closing(layout)[: len(group)]
    return float(np.mean(group[: len(known)] == known)) > _ALIKE


@dataclass(frozen=True)
class Layout:
    """The layout of one mode."""

    mode: Mode

    @property
    def module(self) -> int:
        """Panel pixels of a tag's module."""
        return max(_SMALLEST, min(self.mode.width, self.mode.height) // _SHARE)

    @property
    def tag(self) -> int:
        """Panel pixels along a tag's side, white margin included."""
        return TAG_MODULES * self.module

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells; the rest of the panel at its right and bottom is dark."""
        return self.mode.height // self.mode.cell, self.mode.width // self.mode.cell

    @property
    def group(self) -> int:
        """Symbols of a group."""
        return self.mode.code.symbols

    @property
    def closing(self) -> int:
        """Symbols after the last group, of _CLOSING ticks or more."""
        return -(-_CLOSING // self.mode.ticks)

    @cached_property
    def pilot_columns(self) -> npt.NDArray[np.intp]:
        """Columns of cells that are pilots, evenly spread."""
        columns = self.shape[1]
        count = min(max(columns // _PILOT, _FEWEST), _MOST if self.mode.format == 1 else _SPARSE)
        return ((np.arange(count) + 0.5) * columns / count).astype(np.intp)

    @cached_property
    def free(self) -> npt.NDArray[np.bool_]:
        """Cells that touch no tag, (rows, columns) bool."""
        (rows, columns), covered = self.shape, -(-self.tag // self.mode.cell)
        right = (self.mode.width - self.tag) // self.mode.cell
        down = (self.mode.height - self.tag) // self.mode.cell
        row, column = np.arange(rows), np.arange(columns)
        edge_rows = (row < covered) | (row >= down)
        edge_columns = (column < covered) | (column >= right)
        return ~(edge_rows[:, None] & edge_columns[None, :])

    @cached_property
    def pilot(self) -> npt.NDArray[np.bool_]:
        """Cells that are pilots, (rows, columns) bool."""
        mask = np.zeros(self.shape, np.bool_)
        mask[:, self.pilot_columns] = True
        return mask & self.free

    @cached_property
    def data(self) -> npt.NDArray[np.intp]:
        """Data cells as indices into the flattened (rows, columns), ascending, (cells,)."""
        return np.flatnonzero(self.free & ~self.pilot)

    @property
    def cells(self) -> int:
        """Number of data cells."""
        return len(self.data)

    def group_bytes(self, groups: int) -> int:
        """Whole bytes that all data cells carry in `groups` groups."""
        return self.cells * self.mode.code.bits * groups // 8
