"""The memories of the board: numbered writes, the capture memory, and the display sink.

A line without acknowledgement may lose, repeat or reorder writes. A numbered write consists of
number, byte address, count and words. The board performs it only if its number is the next one,
and then expects the following number. So a repeated or a late one has no effect, and the host
repeats a write until its number has been passed.

The capture memory is read as a FIFO whose pointer can be set back: records of rows with sequence
number and CRC-32.

At the sink, planes arrive word by word over the line and are displayed tile by tile. The words of a
tile leave its FIFO one edge before the tile is displayed. A row is counted one edge
after its last tile.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from rtl_model.geometry import Geometry
from rtl_model.registers import WRITE_WORDS

_NUMBER, _ADDRESS, _COUNT = 0, 1, 2  # words of the memory; the data follow
_WORD = 0xFFFFFFFF


class NumberedWrites:
    """State of the memory; only a power cycle clears it.

    Attributes:
        number: the next number, modulo 2^32.
        arrived: numbered writes that arrived, with whatever number, modulo 2^32.
    """

    def __init__(self) -> None:
        self.number = self.arrived = 0
        self._open = self._fixed = False
        self._address = self._left = 0

    def write(self, index: int, value: int) -> int | None:
        """Writes word `index`; returns the byte address that the value is passed on to, if any."""
        if index == _NUMBER:
            self._open = value == self.number
            self.arrived = self.arrived + 1 & _WORD
        elif index == _ADDRESS:
            self._address, self._fixed = value & ~3, bool(value & 1)
        elif index == _COUNT:
            self._left = value % WRITE_WORDS
        elif self._open and self._left:
            address = self._address
            self._address = address + (0 if self._fixed else 4) & _WORD
            self._left -= 1
            if not self._left:
                self._open = False
                self.number = self.number + 1 & _WORD
            return address
        return None

    def whole(self, data: bytes) -> tuple[int, bytes] | None:
        """Byte address and words (big-endian) of a complete numbered write that is the next one.

        None for others, and for words that all go to one address.
        """
        number, address, count = (int.from_bytes(data[at : at + 4], "big") for at in (0, 4, 8))
        if number != self.number or address & 3 or not 0 < 4 * count == len(data) - 12:
            return None
        return address, data[12:]

    def perform(self) -> None:
        """Counts a write that `whole` has returned and that was performed."""
        self._open = False
        self.arrived = self.arrived + 1 & _WORD
        self.number = self.number + 1 & _WORD

    def read(self, index: int) -> int:
        """Reads word `index`."""
        return (self.number, self.arrived)[index] if index < _COUNT else 0


def record(sequence: int, frame: int, row: int, words: Sequence[int]) -> list[int]:
    """The 32-bit words of a captured row: sequence, frame and row, bits, CRC-32.

    The CRC is zlib's, of all words before it, each most significant byte first.
    """
    words_before = [sequence & 0xFFFFFFFF, (frame & 0xFFFFF) << 12 | row, *words]
    return [*words_before, zlib.crc32(b"".join(word.to_bytes(4, "big") for word in words_before))]


class Capture:
    """Bursts and their memory.

    `store` takes a row when it is computed. The row is in memory from its due clock on.

    Attributes:
        size: size of the memory, words.
        source: register `capture_source`; `taken` is the source of the burst in progress.
        armed: whether a burst starts with the next frame.
        active: whether a frame of the burst is being read, or one follows.
        done: whether the burst is over.
        left: frames of the burst that have not begun.
        memory: its words.
        pointer, rows, lost: registers `capture_*` of that name.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.source = 0
        self.arm(0)
        self.done = False

    def arm(self, frames: int) -> None:
        """Empties the memory; a burst of `frames` frames starts with the next frame."""
        self.armed, self.done = frames > 0, frames == 0
        self.active = False
        self.left = frames
        self.taken = 0
        self.memory: list[int] = []
        self.pointer = self.rows = self.lost = self._sequence = self._promised = 0
        self._pending: deque[tuple[int, list[int]]] = deque()
        self._end: int | None = None

    @property
    def busy(self) -> bool:
        """Whether rows are being stored or may still follow."""
        return self.active or self._end is not None

    def frame_begins(self, due: int) -> None:
        """Starts a frame. If it is the last of the burst, the burst ends at clock `due`."""
        if self.armed:
            self.armed, self.active, self.taken = False, True, self.source
        if self.active:
            if self.left == 0:
                self.active = False
                return
            self.left -= 1
            if self.left == 0:
                self._end = due

    @property
    def takes(self) -> bool:
        """Whether rows of the frame in progress belong to the burst."""
        return self.active

    def store(self, due: int, frame: int, row: int, words: Sequence[int]) -> None:
        """Stores a row, in memory from clock `due` on, or counts it as lost."""
        if self._promised + len(words) + 3 > self.size:
            self.lost += 1
        else:
            self._pending.append((due, record(self._sequence, frame, row, words)))
            self._promised += len(words) + 3
        self._sequence += 1

    def settle(self, clock: int) -> None:
        """Moves the rows due before edge `clock` into the memory."""
        while self._pending and self._pending[0][0] <= clock:
            self.memory += self._pending.popleft()[1]
            self.rows += 1
        if self._end is not None and self._end <= clock:
            self.active, self.done, self._end = False, True, None

    @property
    def state(self) -> int:
        """The register capture_state."""
        return self.armed | self.busy << 1 | self.done << 2 | (self.lost > 0) << 3

    @property
    def level(self) -> int:
        """Words between pointer and end."""
        return len(self.memory) - self.pointer

    def word(self, index: int) -> int:
        """Word `index` of the memory; 0 beyond the end."""
        return self.memory[index] if index < len(self.memory) else 0

    def seek(self, value: int) -> None:
        """Sets the pointer, at most to the end."""
        self.pointer = min(value, len(self.memory))

    def next(self) -> int:
        """Reads the next word and advances the pointer; 0 at the end."""
        if self.level == 0:
            return 0
        self.pointer += 1
        return self.memory[self.pointer - 1]


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
