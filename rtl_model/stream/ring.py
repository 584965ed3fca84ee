"""Tiles to an AXI4-Stream through a ring buffer (`viform_stream.v`), edge by edge.

A packet is a row: a head with the plane's number and the row, then the row's tiles. A row that does
not fit into the ring is lost with all rows that follow in its plane.
"""

from __future__ import annotations

from collections import deque
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")


class Tile(NamedTuple):
    """A tile at the pins of its source.

    Attributes:
        frame, row, tile: number of the plane, row, tile of the row.
        bits: its pixels, the first in bit 0.
    """

    frame: int
    row: int
    tile: int
    bits: int


class Beat(NamedTuple):
    """A transfer of the stream.

    Attributes:
        data: `TDATA`: a head (number of the plane modulo 2^20 in bits 31:12, row in bits 11:0), or
            the bits of a tile.
        last: `TLAST`: last beat of a row.
        user: `TUSER`: bit 0 at the head of a plane's first row, bit 1 if the plane before it in the
            stream lacks rows.
    """

    data: int
    last: bool
    user: int


class Fifo(Generic[T]):
    """`viform_fifo.v`: a queue in block RAM, whose first word stands at the output.

    Attributes:
        words: words in memory.
        out: the word at the output, None for none.
    """

    def __init__(self) -> None:
        self.words: deque[T] = deque()
        self.out: T | None = None

    def edge(self, put: T | None, ready: bool) -> None:
        """A clock edge: takes a word, unless None, and passes one on if the output is free."""
        if self.out is None or ready:
            self.out = self.words.popleft() if self.words else None
        if put is not None:
            self.words.append(put)


class Ring:
    """Ring buffer of one source, whose output is its AXI4-Stream.

    Args:
        tiles: tiles of a row.
        depth: depth of the ring, beats, at least `tiles` + 1.

    Attributes:
        lost_planes: number of planes with at least one lost row, modulo 2^32.
        lost_rows: number of lost rows, modulo 2^32.
    """

    def __init__(self, tiles: int, depth: int) -> None:
        self.tiles, self.depth = tiles, depth
        self.reset()

    def reset(self) -> None:
        """Empties the ring and clears the counters."""
        self._fifo: Fifo[Beat] = Fifo()
        self.lost_planes = self.lost_rows = 0
        self._place: tuple[int, int] | None = None  # frame and row of the last head
        self._taking = False  # whether the row in progress goes into the ring
        self._incomplete = False  # whether the last plane in the stream lacks rows
        self._cut = False  # whether the plane in progress has lost a row
        self._held: Beat | None = None  # the tile of the last edge: a head goes before it

    @property
    def beat(self) -> Beat | None:
        """What the stream offers before the next edge; None while `TVALID` is low."""
        return self._fifo.out

    def edge(self, tile: Tile | None, ready: bool) -> None:
        """A clock edge.

        Args:
            tile: tile at the pins before the edge. Between rows there is a clock without one.
            ready: `TREADY`.
        """
        put, self._held = self._held, None
        if tile is not None and tile.tile == 0:
            head = self._head(tile)
            self._taking = head is not None
            put = put or head
        if tile is not None and self._taking:
            self._held = Beat(tile.bits, tile.tile == self.tiles - 1, 0)
        self._fifo.edge(put, ready)

    def _head(self, tile: Tile) -> Beat | None:
        """The head of a row, None if the row is lost."""
        before, self._place = self._place, (tile.frame, tile.row)
        opens = before is None or before[0] != tile.frame or tile.row <= before[1]
        fits = len(self._fifo.words) + self.tiles + 1 <= self.depth
        if fits and (opens or not self._cut):
            self._cut = False
            user = 0
            if opens:
                user = 1 | self._incomplete << 1
                self._incomplete = False
            return Beat((tile.frame & 0xFFFFF) << 12 | tile.row & 0xFFF, False, user)
        self.lost_rows = (self.lost_rows + 1) & 0xFFFFFFFF
        if opens or not self._cut:
            self.lost_planes = (self.lost_planes + 1) & 0xFFFFFFFF
        if not opens and not self._cut:
            self._incomplete = True
        self._cut = True
        return None
