"""Stored spike words of a stream, and views of a few pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Viform, Words

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Gap:
    """Ticks that are missing at a place of a recording.

    Attributes:
        tick: first stored tick after them.
        count: number of missing ticks.
        last: last tick that may be the first after them: while the pilots stay on or off, they do
            not tell where.
    """

    tick: int
    count: int
    last: int


def _shifted(words: Words, count: int) -> Words:
    """Words (n, ...) whose bits come `count` ticks later, 1 to WORD - 1; the first are 0, and the
    last fall out."""
    out = words << np.uint32(count)
    out[1:] |= words[:-1] >> np.uint32(WORD - count)
    return np.asarray(out)


class Recording:
    """Words of a camera for ticks `first` to `stop`; tick k is latch cycle k. Blocks have no gaps.

    Attributes:
        shape: (height, width) of the camera.
        first, stop: stored ticks.
        begun: whether a block has arrived.
        gaps: ticks that the stream lacked and that were put in as ticks without spikes, in order of
            their discovery. The ticks of later blocks are counted with them.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self._parts: list[Words] = []
        self._joined: Words | None = None
        self.first = self.stop = 0
        self.begun = False
        self.gaps: list[Gap] = []

    def add(self, viform: Viform) -> None:
        """Adds a block. Raises ValueError if its shape differs or it does not follow the last
        one."""
        if viform.shape != self.shape:
            raise ValueError(f"a block must be {self.shape}, not {viform.shape}")
        if not self.begun:
            self.first = self.stop = viform.start
            self.begun = True
        expected = self.stop - sum(gap.count for gap in self.gaps)
        if viform.start != expected:
            raise ValueError(f"a block must begin at cycle {expected}, not {viform.start}")
        self._joined = None
        filled = (self.stop - self.first) % WORD
        if not filled:
            self._parts.append(viform.words)
        else:  # the last word is not full: all bits after it are shifted
            last = self._parts[-1][-1:] | (viform.words[:1] << np.uint32(filled))
            rest = viform.words >> np.uint32(WORD - filled)
            rest[:-1] |= viform.words[1:] << np.uint32(filled)
            count = -(-(self.stop + viform.cycles - self.first) // WORD)
            held = sum(len(part) for part in self._parts)
            self._parts[-1] = np.concatenate([self._parts[-1][:-1], last, rest])
            self._parts[-1] = self._parts[-1][: len(self._parts[-1]) - (held + len(rest) - count)]
        self.stop += viform.cycles

    @property
    def ticks(self) -> int:
        """Number of stored ticks."""
        return self.stop - self.first

    @property
    def words(self) -> Words:
        """(n, height, width) uint32; bit 0 of word 0 is tick `first`."""
        if self._joined is None:
            if not self._parts:
                return np.zeros((0, *self.shape), np.uint32)
            joined = self._parts[0] if len(self._parts) == 1 else np.concatenate(self._parts)
            self._parts = [joined]
            self._joined = joined
        return self._joined

    def forget(self, tick: int) -> None:
        """Drops whole words before a tick."""
        gone = min(max(tick - self.first, 0) // WORD, self.ticks // WORD)
        if gone:
            self._parts = [self.words[gone:].copy()]
            self._joined = None
            self.first += gone * WORD

    def put_in(self, gap: Gap) -> None:
        """Puts in the ticks that a gap lacks, at the first of its places, without spikes."""
        if not self.first <= gap.tick <= self.stop:
            raise ValueError(f"a gap must be in {self.first} to {self.stop}, not at {gap.tick}")
        size = -(-(self.ticks + gap.count) // WORD) - len(self.words)
        words = np.concatenate([self.words, np.zeros((max(size, 0), *self.shape), np.uint32)])
        w, bit = divmod(gap.tick - self.first, WORD)
        later = _shifted(words[w:], gap.count)
        head = words[w] & np.uint32((1 << bit) - 1)
        free = ((1 << gap.count) - 1) << bit
        for n, some in enumerate(later[:2]):
            some &= ~np.uint32((free >> (WORD * n)) & 0xFFFFFFFF)
        later[0] &= ~np.uint32((1 << bit) - 1)
        later[0] |= head
        words[w:] = later
        self._parts, self._joined = [words], None
        self.stop += gap.count
        self.gaps.append(gap)

    def rates(self, first: int, stop: int) -> npt.NDArray[np.float32]:
        """Spikes a tick of each pixel in ticks first to stop, (height, width) float32.

        Only whole words within the ticks count, or all bits if there is no whole word.
        """
        a, b = self._span(first, stop)
        low, high = -(-a // WORD), b // WORD
        if high > low:
            total = np.zeros(self.shape, np.uint32)
            for w in range(low, high):
                total += np.bitwise_count(self.words[w])
            return total.astype(np.float32) / np.float32((high - low) * WORD)
        total = np.zeros(self.shape, np.uint32)
        for t in range(a, b):
            total += (self.words[t // WORD] >> np.uint32(t % WORD)) & np.uint32(1)
        return total.astype(np.float32) / np.float32(max(b - a, 1))

    def _span(self, first: int, stop: int) -> tuple[int, int]:
        return max(first - self.first, 0), min(stop - self.first, self.ticks)

    def pixels(
        self, rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]
    ) -> npt.NDArray[np.uint8]:
        """Bits of single pixels, (ticks, n) of 0 and 1, from tick `first` on."""
        picked = np.ascontiguousarray(self.words[:, rows, columns].T).astype("<u4", copy=False)
        bits = np.unpackbits(picked.view(np.uint8), axis=1, bitorder="little")
        return np.ascontiguousarray(bits[:, : self.ticks].T)

    def totals(self, every: int = 1) -> Floats:
        """Share of pixels that fire in each tick, (ticks,), from every n-th row."""
        words = self.words[:, ::every]
        out = np.zeros(len(words) * WORD)
        for w, word in enumerate(words):
            flat = np.ascontiguousarray(word).ravel()
            for b in range(WORD):
                out[w * WORD + b] = np.count_nonzero(flat & np.uint32(1 << b))
        size = max(words.shape[1] * words.shape[2], 1)
        return out[: self.ticks] / size
