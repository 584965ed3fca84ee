"""The capture memory: records of rows with sequence number and CRC-32.

It is read as a FIFO whose pointer can be set back.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Sequence


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
