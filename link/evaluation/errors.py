"""Bit errors of the receiver's decisions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import TRAINING, Layout
from link.receiving import Received
from link.setup.setup import FileSetup

LISTED: Final = 100_000
"""Wrong decisions whose places are kept, at most: those of a link that works."""

Symbols = Callable[[int, int], npt.NDArray[np.bool_]]
"""(first, count) -> (count, cells) of the data cells."""


@dataclass(frozen=True, eq=False)
class Errors:
    """Wrong decisions on single symbols, before any code.

    Attributes:
        wrong: number of wrong decisions.
        symbols: number of symbols compared.
        by_cell: (rows, columns) int64, wrong decisions of each cell, -1 for a cell without data.
        by_symbol: (symbols,) int64, wrong decisions of each symbol.
        at_end: wrong decisions of the transmission's last symbol, 0 if it was not compared.
        places: (n, 2) int32, symbol and data cell of the first `LISTED` wrong decisions.
    """

    wrong: int
    symbols: int
    by_cell: npt.NDArray[np.int64]
    by_symbol: npt.NDArray[np.int64]
    at_end: int = 0
    places: npt.NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 2), np.int32))

    @property
    def bits(self) -> int:
        """Number of bits compared."""
        return self.symbols * int((self.by_cell >= 0).sum())

    @property
    def rate(self) -> float | None:
        """Raw bit error rate; None if nothing was compared."""
        return self.wrong / self.bits if self.bits else None


def count_errors(sent: Symbols, decided: Symbols, layout: Layout, symbols: Sequence[int],
                 last: int | None = None) -> Errors:  # fmt: skip
    """Compares decisions with what was sent.

    Args:
        sent, decided: bits of the data cells.
        layout: layout of the cells.
        symbols: numbers of the symbols to compare.
        last: number of the transmission's last symbol.
    """
    by_cell = np.zeros(layout.cells, np.int64)
    by_symbol = np.zeros(len(symbols), np.int64)
    places, room = [np.zeros((0, 2), np.int32)], LISTED
    for n, symbol in enumerate(symbols):
        wrong = sent(symbol, 1)[0] != decided(symbol, 1)[0]
        by_cell += wrong
        by_symbol[n] = wrong.sum()
        if room:
            cells = np.flatnonzero(wrong)[:room]
            places.append(np.column_stack([np.full(cells.size, symbol), cells]).astype(np.int32))
            room -= cells.size
    grid = np.full(layout.shape, -1, np.int64)
    grid.ravel()[layout.data] = by_cell
    at_end = sum(int(by_symbol[n]) for n, symbol in enumerate(symbols) if symbol == last)
    where = np.concatenate(places)
    return Errors(int(by_cell.sum()), len(symbols), grid, by_symbol, at_end, where)


def errors_of(setup: FileSetup, received: Received) -> Errors:
    """Counts wrong decisions, over the symbols that were read in the mode that was sent."""
    read = sorted(received.packed) if received.mode == setup.mode else []
    symbols = [n for n in read if TRAINING <= n < setup.sent.data_end]
    return count_errors(
        setup.sent.bits, received.decided, setup.sent.layout, symbols, setup.sent.data_end - 1
    )
