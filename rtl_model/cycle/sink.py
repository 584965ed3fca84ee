"""The display sink: planes arrive word by word over the line and are displayed tile by tile.

The words of a tile leave the FIFO one edge before the tile is displayed. A row is counted one edge
after its last tile.
"""

from __future__ import annotations

import zlib
from collections import deque
from typing import NamedTuple

from rtl_model.geometry import Geometry


class SinkTile(NamedTuple):
    """A displayed tile.

    Attributes:
        clock: edge at which it is displayed.
        row, tile: row of the plane, and tile of the row.
        bits: its pixels, the first in bit 0.
    """

    clock: int
    row: int
    tile: int
    bits: int


class Sink:
    """A FIFO of words, and the planes that are displayed from it.

    Attributes:
        geometry: geometry of the build.
        left: number of frames to display.
        words: words in the FIFO.
        rows, crc, underruns, lost: registers `sink_*` of that name.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self.left = 0
        self._start: int | None = None  # edge at which the displayed frame began
        self._taken = self._displayed = self._rows = 0  # tiles and rows of it so far
        self.clear()

    def clear(self) -> None:
        """Empties the FIFO and sets the counters to 0; `left` does not change."""
        self.words: deque[int] = deque()
        self._next_words: list[int] = []  # of the next tile
        self.rows = self.crc = self.underruns = self.lost = 0

    @property
    def active(self) -> bool:
        """Whether a frame is displayed at present."""
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
        """Starts a frame, which is displayed if planes are left."""
        self._start = clock if self.left > 0 else None
        self.left -= self.active
        self._taken = self._displayed = self._rows = 0

    def run(self, stop: int) -> list[SinkTile]:
        """Runs the edges before `stop` of the frame in progress; returns the displayed tiles."""
        size, start = self.geometry, self._start
        tiles: list[SinkTile] = []
        if start is None:
            return tiles
        taken, displayed = self._tiles(stop - start), self._tiles(stop - start - 1)
        for place in range(self._displayed, displayed):
            while self._taken <= place:
                self._take()
            row, index = divmod(place, size.tiles)
            clock = start + 1 + row * size.row_clocks + index
            tiles.append(SinkTile(clock, row, index, self._display()))
            if place + 1 < taken and self._taken == place + 1:
                self._take()
        while self._taken < taken:
            self._take()
        self._displayed = displayed
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

    def _display(self) -> int:
        due = self.geometry.lanes // 32
        self.underruns += due - len(self._next_words)
        words = self._next_words + [0] * (due - len(self._next_words))
        self._next_words = []
        for word in words:
            self.crc = zlib.crc32(word.to_bytes(4, "big"), self.crc)
        return sum(word << 32 * n for n, word in enumerate(words))
