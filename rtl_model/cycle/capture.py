"""The capture memory: a burst of rows as records with sequence number and CRC-32, drained as a
FIFO whose pointer may be set back."""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Sequence

__all__ = ["Capture", "record"]


def record(sequence: int, frame: int, row: int, words: Sequence[int]) -> list[int]:
    """Returns the 32-bit words of a captured row: sequence, frame and row, bits, CRC-32 of all
    that (zlib's, each word most significant byte first)."""
    made = [sequence & 0xFFFFFFFF, (frame & 0xFFFFF) << 12 | row, *words]
    return [*made, zlib.crc32(b"".join(word.to_bytes(4, "big") for word in made))]


class Capture:
    """Bursts and the memory they fill. Rows come by `store` when they are computed and are in
    memory from their due clock on."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.source = 0  # the register; `taken` is what the burst runs on
        self.arm(0)
        self.done = False

    def arm(self, frames: int) -> None:
        """Empties the memory; a burst of `frames` frames starts with the next frame."""
        self.armed, self.done = frames > 0, frames == 0
        self.active = False  # a frame of the burst is being read, or one follows
        self.left = frames
        self.taken = 0
        self.memory: list[int] = []
        self.pointer = self.rows = self.lost = self._sequence = self._promised = 0
        self._late: deque[tuple[int, list[int]]] = deque()
        self._end: int | None = None

    @property
    def busy(self) -> bool:
        """Whether rows are being stored or may still come."""
        return self.active or self._end is not None

    def frame_begins(self, due: int) -> None:
        """A frame starts; if it is the last of the burst, that is over at clock `due`."""
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
        """Whether rows of the frame under way belong to the burst."""
        return self.active

    def store(self, due: int, frame: int, row: int, words: Sequence[int]) -> None:
        """Takes a row whose record is in memory at clock `due`, or counts it as lost."""
        if self._promised + len(words) + 3 > self.size:
            self.lost += 1
        else:
            self._late.append((due, record(self._sequence, frame, row, words)))
            self._promised += len(words) + 3
        self._sequence += 1

    def settle(self, clock: int) -> None:
        """Puts into memory what is due before edge `clock`."""
        while self._late and self._late[0][0] <= clock:
            self.memory += self._late.popleft()[1]
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

    def seek(self, value: int) -> None:
        """Sets the pointer, at most to the end."""
        self.pointer = min(value, len(self.memory))

    def next(self) -> int:
        """Returns the next word and moves on; 0 at the end."""
        if self.level == 0:
            return 0
        self.pointer += 1
        return self.memory[self.pointer - 1]
