"""The light on a band of rows, of a scene that draws whole planes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cosim import Block, Light, Piece, Plane
from cosim.light.source import Source


class Strip:
    """Rows of the light of a scene.

    The scene is asked cycle by cycle and each of its planes is cut at once, so that no more than a
    few whole planes are in memory: those that the scene and the lens keep.

    Args:
        source: the scene.
        relay: its light to that on the pixels; it may need whole planes.
        rows: first row, and the one after the last.
        reach: cycles before and after a block whose light the block needs as well.
    """

    def __init__(
        self, source: Source, relay: Callable[[Light], Light], rows: tuple[int, int],
        reach: tuple[int, int],
    ) -> None:  # fmt: skip
        self._source, self._relay = source, relay
        self._rows, self._reach = rows, reach
        self._cycle = 0
        self._last: Piece | None = None
        self._cuts: list[tuple[Plane, Plane]] = []
        self._pieces: list[Piece] = []

    def _cut(self, plane: Plane) -> Plane:
        for whole, cut in self._cuts:
            if whole is plane:
                return cut
        cut = np.ascontiguousarray(plane[self._rows[0] : self._rows[1]])
        self._cuts = [*self._cuts[-1:], (plane, cut)]
        return cut

    def _piece(self, piece: Piece) -> Piece:
        low, high = self._rows
        box = piece.changed
        if box is not None:
            top, bottom = (min(max(row - low, 0), high - low) for row in box[:2])
            box = (top, bottom, *box[2:]) if top < bottom else (0, 0, 0, 0)
        return Piece(piece.start, piece.stop, self._cut(piece.first), self._cut(piece.last), box)

    def step(self, block: Block, start_ps: int) -> Light:
        """Light of a block and of the cycles around it.

        Args:
            block: the block; blocks follow each other.
            start_ps: instant from which on light is needed, ps.
        """
        while self._cycle < block.stop + self._reach[1]:
            light = self._relay(self._source.step(None, Block(self._cycle, 1)))
            for piece in light.pieces:
                if self._last is None or piece.start >= self._last.stop:
                    self._pieces.append(self._piece(piece))
                    self._last = piece
            self._cycle += 1
        self._pieces = [piece for piece in self._pieces if piece.stop > start_ps]
        return Light(tuple(self._pieces))
