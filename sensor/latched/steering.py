"""Ticks of other lengths: sampling instants that a steered clock moves from its mean clock.

All rows move together. The light of a longer tick is gathered for longer, since the pixels gather
all the time: only the instants move, as with timing noise (`row_timing`), which is added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sensor.latched.row_timing import RowMoves

Moves = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ClockMoves:
    """Moves of a clock's edges.

    Attributes:
        ps: (edges,) int64, ps by which edge k comes after that of the setting's clock; the last one
            holds for all later edges, and 0 for edge 0 and all before.
    """

    ps: Moves

    def __post_init__(self) -> None:
        if self.ps.ndim != 1 or not self.ps.size or self.ps[0] != 0:
            raise ValueError("moves of a clock must begin with 0 at edge 0")

    @property
    def most(self) -> int:
        """Largest move, ps."""
        return int(np.abs(self.ps).max())

    def at(self, edge: int, count: int) -> Moves:
        """Moves of edges `edge` to `edge + count`, (count,)."""
        return self.ps[np.clip(np.arange(edge, edge + count), 0, self.ps.size - 1)]

    def on(self, rows: int, noise: RowMoves | None) -> RowMoves:
        """Moves on a plane of `rows` rows, those of timing noise included."""
        return _Steered(self, rows, noise)


class _Steered:
    """Moves of a steered clock and of timing noise; see `RowMoves`."""

    def __init__(self, clock: ClockMoves, rows: int, noise: RowMoves | None) -> None:
        self.height, self.first, self.stop = rows, 0, rows
        self.most = clock.most + (0 if noise is None else noise.most)
        self._clock, self._noise = clock, noise

    @property
    def noisy(self) -> npt.NDArray[np.bool_]:
        return np.ones(self.height, np.bool_)

    def moves(self, edge: int, count: int) -> Moves:
        moved = np.repeat(self._clock.at(edge, count)[:, None], self.height, axis=1)
        if self._noise is not None:
            band = slice(self._noise.first, self._noise.stop)
            moved[:, band] += self._noise.moves(edge, count)
        return moved
