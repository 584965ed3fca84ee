"""The receiver's decisions beside what was sent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from link.layout import Layout

__all__ = ["Errors", "Symbols", "count_errors"]

Symbols = Callable[[int, int], npt.NDArray[np.bool_]]
"""(first, count) -> (count, cells) of the data cells."""


@dataclass(frozen=True, eq=False)
class Errors:
    """Decisions on single symbols beside what was sent, before any code. symbols: compared.
    by_cell: (rows, columns) int64, wrong ones of each cell, -1 where a cell carries no data. by_
    symbol: (symbols,) int64, wrong ones of each symbol. at_end: wrong ones of the transmission's
    last symbol, 0 where that was not compared."""

    wrong: int
    symbols: int
    by_cell: npt.NDArray[np.int64]
    by_symbol: npt.NDArray[np.int64]
    at_end: int = 0

    @property
    def bits(self) -> int:
        """Compared."""
        return self.symbols * int((self.by_cell >= 0).sum())

    @property
    def rate(self) -> float | None:
        """The raw bit error rate; None where nothing was compared."""
        return self.wrong / self.bits if self.bits else None


def count_errors(sent: Symbols, decided: Symbols, layout: Layout, symbols: Sequence[int],
                 last: int | None = None) -> Errors:  # fmt: skip
    """symbols: numbers of those that are compared. last: that of the transmission's last one."""
    by_cell = np.zeros(layout.cells, np.int64)
    by_symbol = np.zeros(len(symbols), np.int64)
    for n, symbol in enumerate(symbols):
        wrong = sent(symbol, 1)[0] != decided(symbol, 1)[0]
        by_cell += wrong
        by_symbol[n] = wrong.sum()
    grid = np.full(layout.shape, -1, np.int64)
    grid.ravel()[layout.data] = by_cell
    at_end = sum(int(by_symbol[n]) for n, symbol in enumerate(symbols) if symbol == last)
    return Errors(int(by_cell.sum()), len(symbols), grid, by_symbol, at_end)
