"""The display sink: planes that come word by word over the line and are shown tile by tile."""

from __future__ import annotations

import zlib
from collections import deque

__all__ = ["Sink"]


class Sink:
    """A FIFO of words and what became of them."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.left = 0  # frames still to be shown
        self.active = False  # the frame under way is shown
        self.clear()

    def clear(self) -> None:
        """Empties the FIFO and sets the counters to 0; planes still to be shown stay so."""
        self.words: deque[int] = deque()
        self.rows = self.crc = self.underruns = self.lost = 0

    @property
    def state(self) -> int:
        """The register sink_state."""
        running = self.left > 0 or self.active
        return running | (self.underruns > 0) << 1 | (self.lost > 0) << 2

    def push(self, word: int) -> None:
        """Takes a word, or counts it as lost where there is no room."""
        if len(self.words) < self.size:
            self.words.append(word)
        else:
            self.lost += 1

    def frame_begins(self) -> None:
        """A frame starts, which is shown if planes are left."""
        self.active = self.left > 0
        self.left -= self.active

    def show(self, count: int) -> int:
        """Returns the next tile of `count` words, the first in the low bits; missing ones are 0."""
        bits = 0
        for n in range(count):
            if self.words:
                word = self.words.popleft()
            else:
                word = 0
                self.underruns += 1
            self.crc = zlib.crc32(word.to_bytes(4, "big"), self.crc)
            bits |= word << 32 * n
        return bits
