"""Soft values of some cells over the symbols of a transmission, and a sample of all.

All soft values of a recording are too many to store: a megapixel panel gives a million with every
symbol. Watched are cells of a lattice over the panel, which stand for all, and the least certain
cells of the first symbols, which are those that fail.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout

CELLS: Final = 2000
"""Cells of each of the two sets, at most."""
VALUES: Final = 2_000_000
"""Soft values that are stored, at most: those of the first symbols."""
_SAMPLED: Final = 65_536
_SAMPLES: Final = 800_000
"""Largest number of soft values of a sample: _SAMPLED of a chunk, and about _SAMPLES of all."""


class SoftSample:
    """A sample of soft values, evenly from the first symbols."""

    def __init__(self) -> None:
        self._soft: list[npt.NDArray[np.float32]] = []
        self._at: list[npt.NDArray[np.int64]] = []

    def add(self, first: int, soft: npt.NDArray[np.float32]) -> None:
        """Takes some of the soft values, (symbols, cells), of symbols from `first` on."""
        if sum(len(part) for part in self._soft) < _SAMPLES:
            stride = max(1, soft.size // _SAMPLED) | 1  # odd, so that it samples all symbols
            picked = np.arange(0, soft.size, stride)
            of, cell = np.divmod(picked, soft.shape[1])
            self._soft.append(soft.ravel()[picked])
            self._at.append(np.stack([of + first, cell], 1).astype(np.int64))

    @property
    def soft(self) -> npt.NDArray[np.float32]:
        """(n,) soft values."""
        return np.concatenate([np.zeros(0, np.float32), *self._soft])

    @property
    def at(self) -> npt.NDArray[np.int64]:
        """(n, 2) symbol and data cell of each."""
        return np.concatenate([np.zeros((0, 2), np.int64), *self._at])


@dataclass(frozen=True, eq=False)
class Watched:
    """Soft values of some cells.

    Attributes:
        cells: (n,) data cells, ascending.
        symbols: (m,) numbers of the symbols, ascending; with gaps where some were not read.
        soft: (m, n) float16, ln P(spikes | on) - ln P(spikes | off).
    """

    cells: npt.NDArray[np.intp]
    symbols: npt.NDArray[np.int64]
    soft: npt.NDArray[np.float16]


def _lattice(layout: Layout) -> npt.NDArray[np.intp]:
    """Data cells at every n-th row and column, at most `CELLS`."""
    rows, columns = layout.shape
    step = int(np.ceil(np.sqrt(rows * columns / CELLS)))
    row, column = np.divmod(layout.data, columns)
    on = (row % step == step // 2) & (column % step == step // 2)
    return np.flatnonzero(on)[:CELLS]


class Watcher:
    """Collects the soft values of some cells, chosen at the first symbols."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._cells: npt.NDArray[np.intp] | None = None
        self._parts: list[tuple[int, npt.NDArray[np.float16]]] = []

    def add(self, first: int, soft: npt.NDArray[np.float32]) -> None:
        """Takes the soft values of consecutive symbols from `first` on, (symbols, cells)."""
        if not len(soft):
            return
        if self._cells is None:
            fewest = min(CELLS, soft.shape[1])
            certain = np.abs(soft).mean(axis=0)
            least = np.argpartition(certain, fewest - 1)[:fewest]
            self._cells = np.union1d(_lattice(self._layout), least)
        left = VALUES // self._cells.size - sum(len(part) for _, part in self._parts)
        if left > 0:
            self._parts.append((first, soft[:left, self._cells].astype(np.float16)))

    def result(self) -> Watched | None:
        """What was collected; None without a symbol. A symbol that was read twice, before and
        after an interruption, counts as it was read last."""
        if self._cells is None:
            return None
        last = {
            first + n: row for first, part in self._parts for n, row in enumerate(part)
        }  # fmt: skip
        symbols = sorted(last)
        return Watched(
            self._cells, np.array(symbols, np.int64), np.stack([last[n] for n in symbols])
        )
