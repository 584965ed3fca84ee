"""Where everything stands on the panel, and when: tags, pilots, data, training.

Tags stand in the corners all the time. A few columns of cells are pilots: all of them show the same
known sequence, so that symbols can be counted and timed row by row wherever a recording begins.
Every other cell carries data. Symbols 0 to TRAINING of a transmission show a known pattern in the
data cells as well; from then on each cell carries its line code, in groups of `group` symbols.
Behind the last group the training's first symbols come once more, so that what follows the last
data is like what followed everything else: the tick that two symbols share, the light of the cells
beside and charge that is kept are learned from symbols among others, and darkness behind would
belie them. They carry nothing: a receiver needs no word of them, and a recording without them is
read as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from link.mode import Mode

__all__ = [
    "PERIOD", "TAG_MODULES", "TRAINING", "Layout", "closing",
    "pilots", "training",
]  # fmt: skip

TRAINING: Final = 48
"""Symbols of known data before the first group."""
PERIOD: Final = 960
"""Symbols after which the pilots' sequence begins anew: a multiple of every group."""
TAG_MODULES: Final = 10
"""Of a tag's side: 6 of bits, a black border, a white margin."""
_CLOSING: Final = 2
"""Ticks behind the last group that are lit: the one that its last symbol shares, and one wholly of
what follows, which tells that from darkness."""
_SMALLEST, _SHARE = 4, 96
"""Panel pixels to a tag's module: at least, and the panel's shorter side over this."""
_FEWEST, _MOST, _PILOT = 2, 16, 32
"""Pilot columns: at least, at most, and one to so many columns of cells."""


@cache
def pilots() -> npt.NDArray[np.bool_]:
    """What all pilots show in each symbol of a period, (PERIOD,): a maximal-length sequence of
    x^10 + x^7 + 1 (Golomb, Shift Register Sequences, 1967), cut from 1023."""
    state, out = 1, np.zeros(PERIOD, np.bool_)
    for n in range(PERIOD):
        out[n] = state & 1
        state = (state >> 1) | (((state ^ (state >> 3)) & 1) << 9)
    out.flags.writeable = False  # every caller shares it
    return out


def training(cells: int) -> npt.NDArray[np.bool_]:
    """What the data cells show before the first group, (TRAINING, cells): random in even symbols,
    in odd ones the opposite of the symbol before, so that every cell is on half of the time."""
    rng = np.random.Generator(np.random.Philox(key=0x5649464F524D))
    even = rng.integers(0, 2, (TRAINING // 2, cells), dtype=np.uint8).astype(np.bool_)
    return np.stack([even, ~even], axis=1).reshape(TRAINING, cells)


def closing(layout: Layout) -> npt.NDArray[np.bool_]:
    """What the data cells show behind the last group, (`Layout.closing`, cells)."""
    return training(layout.cells)[: layout.closing]


@dataclass(frozen=True)
class Layout:
    """Of one mode."""

    mode: Mode

    @property
    def module(self) -> int:
        """Panel pixels to a tag's module."""
        return max(_SMALLEST, min(self.mode.width, self.mode.height) // _SHARE)

    @property
    def tag(self) -> int:
        """Panel pixels to a tag's side, its white margin with it."""
        return TAG_MODULES * self.module

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells; what is left of the panel at its right and bottom is dark."""
        return self.mode.height // self.mode.cell, self.mode.width // self.mode.cell

    @property
    def group(self) -> int:
        """Symbols to a group."""
        return self.mode.code.symbols

    @property
    def closing(self) -> int:
        """Symbols behind the last group, of _CLOSING ticks or more."""
        return -(-_CLOSING // self.mode.ticks)

    @cached_property
    def pilot_columns(self) -> npt.NDArray[np.intp]:
        """Columns of cells that are pilots, evenly spread."""
        columns = self.shape[1]
        count = min(max(columns // _PILOT, _FEWEST), _MOST)
        return ((np.arange(count) + 0.5) * columns / count).astype(np.intp)

    @cached_property
    def free(self) -> npt.NDArray[np.bool_]:
        """Cells that touch no tag, (rows, columns)."""
        (rows, columns), covered = self.shape, -(-self.tag // self.mode.cell)
        right = (self.mode.width - self.tag) // self.mode.cell
        down = (self.mode.height - self.tag) // self.mode.cell
        row, column = np.arange(rows), np.arange(columns)
        edge_rows = (row < covered) | (row >= down)
        edge_columns = (column < covered) | (column >= right)
        return ~(edge_rows[:, None] & edge_columns[None, :])

    @cached_property
    def pilot(self) -> npt.NDArray[np.bool_]:
        """Cells that are pilots, (rows, columns)."""
        mask = np.zeros(self.shape, np.bool_)
        mask[:, self.pilot_columns] = True
        return mask & self.free

    @cached_property
    def data(self) -> npt.NDArray[np.intp]:
        """Data cells as indices into the flattened (rows, columns), in order, (cells,)."""
        return np.flatnonzero(self.free & ~self.pilot)

    @property
    def cells(self) -> int:
        """Data cells."""
        return len(self.data)

    def group_bytes(self, groups: int) -> int:
        """Whole bytes that all data cells carry in `groups` groups."""
        return self.cells * self.mode.code.bits * groups // 8
