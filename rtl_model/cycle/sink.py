"""The display sink: planes arrive word by word over the line and are shown tile by tile.

The words of a tile are taken from the FIFO one edge before the tile is shown, and a row counts one
edge after its last tile.
"""

from __future__ import annotations

import zlib
from collections import deque
from typing import NamedTuple

from rtl_model.geometry import Geometry

__all__ = ["Shown", "Sink"]


class Shown(NamedTuple):
    """A tile on the display: edge, row, tile of the row and pixels (first in bit 0)."""

    clock: int
    row: int
    tile: int
    bits: int


class Sink:
    """A FIFO of words, and the planes shown from it.

    Attributes:
        geometry: of the build.
        left: frames still to be shown.
        words: in the FIFO.
        rows, crc, underruns, lost: registers `sink_*` of that name.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.left = 0  # frames still to be shown
        self._start: int | None = None  # of the frame that is being shown
        self._taken = self._shown = self._rows = 0  # tiles and rows of it so far
        self.clear()

    def clear(self) -> None:
        """Empties the FIFO and sets the counters to 0; planes still to be shown stay so."""
        self.words: deque[int] = deque()
        self._next_words: list[int] = []  # of the tile that is shown next
        self.rows = self.crc = self.underruns = self.lost = 0

    @property
    def active(self) -> bool:
        """Whether a frame is being shown."""
        return self._start is not None

    @property
    def state(self) -> int:
        """The register sink_state."""
        running = self.left > 0 or self.active
        return running | (self.underruns > 0) << 1 | (self.lost > 0) << 2

    @property
    def room(self) -> bool:
        """Whether the FIFO is not full."""
        return len(self.words) < self.geometry.sink_words

    def push(self, word: int, room: bool) -> None:
        """Takes a word, or counts it as lost if there was no `room` before this edge."""
        if room:
            self.words.append(word)
        else:
            self.lost += 1

    def frame_begins(self, clock: int) -> None:
        """A frame starts; it is shown if planes are left."""
        self._start = clock if self.left > 0 else None
        self.left -= self.active
        self._taken = self._shown = self._rows = 0

    def run(self, stop: int) -> list[Shown]:
        """Runs the edges before `stop` of the frame in progress; returns the tiles shown."""
        size, start = self.geometry, self._start
        tiles: list[Shown] = []
        if start is None:
            return tiles
        takes, shows = self._tiles(stop - start), self._tiles(stop - start - 1)
        for place in range(self._shown, shows):
            while self._taken <= place:
                self._take()
            row, index = divmod(place, size.tiles)
            clock = start + 1 + row * size.row_clocks + index
            tiles.append(Shown(clock, row, index, self._show()))
            if place + 1 < takes and self._taken == place + 1:
                self._take()
        while self._taken < takes:
            self._take()
        self._shown = shows
        rows = self._tiles(stop - start - 2) // size.tiles
        self.rows += rows - self._rows
        self._rows = rows
        if stop - start > size.rows * size.row_clocks:
            self._start = None
        return tiles

    def _tiles(self, passed: int) -> int:
        """Number of tiles in the first `passed` clocks of a scan."""
        size = self.geometry
        row, rest = divmod(max(0, passed), size.row_clocks)
        return min(row * size.tiles + min(rest, size.tiles), size.rows * size.tiles)

    def _take(self) -> None:
        count = min(self.geometry.lanes // 32, len(self.words))
        self._next_words = [self.words.popleft() for _ in range(count)]
        self._taken += 1

    def _show(self) -> int:
        due = self.geometry.lanes // 32
        self.underruns += due - len(self._next_words)
        words = self._next_words + [0] * (due - len(self._next_words))
        self._next_words = []
        for word in words:
            self.crc = zlib.crc32(word.to_bytes(4, "big"), self.crc)
        return sum(word << 32 * n for n, word in enumerate(words))
