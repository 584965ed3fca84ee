"""`Viform`: spike planes as bits, packed pixel by pixel, and the protocol of streams of them.

A word has 32 consecutive latch cycles of one pixel, least significant bit first: bit b of
words[w, i, j] is pixel (i, j) in cycle 32 w + b. The kernels of a chip write these words, and the
shaders of a display read them. Plane-major bytes exist only in files that require them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock

__all__ = [
    "WORD",
    "SpikeStream",
    "Viform",
    "Words",
    "count_spikes",
    "pack_planes",
    "spikes_beyond",
    "unpack_planes",
    "words_for",
]

WORD = 32
"""Latch cycles in a word."""
Words = npt.NDArray[np.uint32]
"""(words, height, width) uint32."""


def words_for(cycles: int) -> int:
    """Words that hold `cycles` latch cycles."""
    return -(-cycles // WORD)


def pack_planes(planes: npt.NDArray[np.bool_] | npt.NDArray[np.uint8]) -> Words:
    """Packs (T, H, W) of 0 and 1 into (ceil(T/32), H, W) words; unused bits are 0."""
    cycles = planes.shape[0]
    words = np.zeros((words_for(cycles), *planes.shape[1:]), np.uint32)
    for t in range(cycles):
        words[t // WORD] |= planes[t].astype(np.uint32) << np.uint32(t % WORD)
    return words


def unpack_planes(words: Words, first: int, stop: int) -> npt.NDArray[np.uint8]:
    """Cycles `first` to `stop` (excluded), counted from words[0], as (T, H, W) uint8 of 0 and 1."""
    planes = np.empty((stop - first, *words.shape[1:]), np.uint8)
    for n, t in enumerate(range(first, stop)):
        planes[n] = (words[t // WORD] >> np.uint32(t % WORD)) & np.uint32(1)
    return planes


def _mask(first: int, stop: int, w: int) -> np.uint32:
    """Bits of word w that belong to cycles first to stop."""
    low, high = max(first - w * WORD, 0), min(stop - w * WORD, WORD)
    return np.uint32(((1 << high) - 1) & ~((1 << low) - 1))


def spikes_beyond(last: npt.NDArray[np.uint32], cycles: int) -> bool:
    """Whether the last words of `cycles` cycles have bits set beyond the last cycle."""
    return bool(cycles % WORD and (last >> np.uint32(cycles % WORD)).any())


def count_spikes(stream: SpikeStream, first: int, stop: int) -> npt.NDArray[np.uint32]:
    """Spikes of each pixel in cycles `first` to `stop` (excluded): (H, W) uint32."""
    total = np.zeros(stream.shape, np.uint32)
    masked, ones = np.empty_like(total), np.empty(stream.shape, np.uint8)  # for all words
    for w in range(first // WORD, words_for(stop)):
        np.bitwise_and(stream.read_words(w, w + 1)[0], _mask(first, stop, w), out=masked)
        total += np.bitwise_count(masked, out=ones)
    return total


class SpikeStream(Protocol):
    """A stream of spike planes in memory, in a file or in the store of a run.

    `read_words(first, stop)` returns words `first` to `stop` (excluded) as (n, H, W) uint32, a view
    or a copy that must not be modified. Bits beyond the last cycle are 0.
    """

    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def cycles(self) -> int: ...
    @property
    def clock(self) -> Clock: ...
    def read_words(self, first: int, stop: int) -> Words: ...


@dataclass(frozen=True, eq=False)
class Viform:
    """Spike planes in memory.

    Attributes:
        words: (ceil(cycles / 32), H, W) uint32.
        cycles: number of latch cycles.
        clock: of the latches.
        start: number of the first cycle.

    Raises:
        ValueError: the words have another shape or type, or spikes beyond the last cycle.
    """

    words: Words
    cycles: int
    clock: Clock
    start: int = 0

    def __post_init__(self) -> None:
        if self.words.ndim != 3 or self.words.dtype != np.uint32:
            raise ValueError(
                f"words must be (n, H, W) uint32, not {self.words.shape} {self.words.dtype}"
            )
        if self.cycles < 1 or len(self.words) != words_for(self.cycles):
            raise ValueError(
                f"{self.cycles} cycles must lie in {words_for(self.cycles)} words, "
                f"not {len(self.words)}"
            )
        if spikes_beyond(self.words[-1], self.cycles):
            raise ValueError(f"spikes must lie within {self.cycles} cycles, not beyond")

    @classmethod
    def from_planes(
        cls, planes: npt.NDArray[np.bool_] | npt.NDArray[np.uint8], clock: Clock
    ) -> Viform:
        """A viform from (T, H, W) planes of 0 and 1, starting at cycle 0."""
        return cls(pack_planes(planes), planes.shape[0], clock)

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self.words.shape[1], self.words.shape[2]

    def read_words(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded), as a view; see `SpikeStream`."""
        return self.words[first:stop]

    def planes(self) -> npt.NDArray[np.uint8]:
        """(T, H, W) uint8 of 0 and 1."""
        return unpack_planes(self.words, 0, self.cycles)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Viform):
            return NotImplemented
        return (
            self.cycles == other.cycles
            and self.clock == other.clock
            and self.start == other.start
            and np.array_equal(self.words, other.words)
        )

    __hash__ = None  # type: ignore[assignment]  # compares by content, which is mutable
