"""A FIFO between two clocks, with Gray-coded pointers and two-stage synchronisers.

Document 002, section 3.2: FIFOs cross clock domains and widths, and a write burst begins if
prog_empty is low. The rest is the usual asynchronous FIFO: each side has its own pointer, one bit
wider than the address, and sees the Gray code of the other pointer two of its own clocks later. A
flip-flop that samples while a bit changes can take either value (`window`). In a Gray code only one
bit changes, so the sampled pointer is the old or the new one; a binary pointer (`gray=False`, for
comparison) can be sampled as a value that never existed. With a late pointer a FIFO only seems
fuller to its writer and emptier to its reader.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cosim.clock import PS
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream


def gray(number: int) -> int:
    """Reflected binary code."""
    return number ^ number >> 1


def ungray(code: int) -> int:
    """The number of a Gray code; the inverse of `gray`."""
    number = 0
    while code:
        number ^= code
        code >>= 1
    return number


class Coin:
    """A sequence of random words from Philox: key (seed, 0), counter (n, use)."""

    _BLOCK = 1024

    def __init__(self, seed: int, use: int) -> None:
        self._seed, self._use, self._at = seed, use, 0
        self._words: list[int] = []

    def word(self) -> int:
        """The next 32 bits."""
        n = self._at % self._BLOCK
        if n == 0:
            counters = np.arange(self._at // 4, (self._at + self._BLOCK) // 4)
            four = philox4x32((counters, 0, self._use, 0), (self._seed, int(Stream.NONE)))
            self._words = np.stack(four, axis=1).ravel().tolist()
        self._at += 1
        return self._words[n]

    def below(self, share: float) -> bool:
        """True with this probability."""
        return self.word() < share * 2**32


def edges_of(hertz: dict[str, int], phases: dict[str, int]) -> Iterator[tuple[int, str]]:
    """(ps, clock) of all rising edges in order of time; edges at the same time in the order of
    `hertz`.

    Edge n of a clock comes at phase + n / f, rounded down to a whole ps.
    """
    counts = dict.fromkeys(hertz, 0)
    following = {name: phases.get(name, 0) for name in hertz}
    while True:
        name = min(following, key=following.__getitem__)
        yield following[name], name
        counts[name] += 1
        following[name] = phases.get(name, 0) + counts[name] * PS // hertz[name]


class _Pointer:
    """A counter and its code as the other clock domain samples it."""

    def __init__(self, coded: bool) -> None:
        self.number = 0
        self._gray = coded
        self._before = self._code = 0
        self._changed = -(10**18)

    def advance(self, now: int, wrap: int) -> None:
        self.number += 1
        place = self.number % wrap
        self._before, self._code = self._code, gray(place) if self._gray else place
        self._changed = now

    def sampled(self, now: int, window: int, coin: Coin) -> int:
        """The code as the other clock domain samples it; changing bits take a random value."""
        open_bits = self._before ^ self._code
        if open_bits and abs(now - self._changed) < window:
            return self._code ^ (coin.word() & open_bits)
        return self._code


class AsyncFifo:
    """depth: words, a power of two. prog_empty: fewer words than this read as nearly empty.
    prog_full: this many words or more read as nearly full. window: ps around a change in which a
    sample may go either way; it must be shorter than either period.

    The word at the front is visible in `front` before it is read (first-word fall-through). A write
    while full and a read while empty have no effect and are counted.
    """

    def __init__(
        self, depth: int = 512, *, prog_empty: int = 64, prog_full: int = 448, window: int = 200,
        seed: int = 0, gray: bool = True,
    ) -> None:  # fmt: skip
        if depth < 4 or depth & depth - 1:
            raise ValueError("depth must be a power of two, 4 or more")
        if not 0 < prog_empty <= depth or not 0 < prog_full <= depth:
            raise ValueError(f"prog_empty and prog_full must be 1 to {depth}")
        self.depth, self.prog_empty_at, self.prog_full_at = depth, prog_empty, prog_full
        self.window = window
        self.overflows = self.underflows = self.most = 0
        self._wrap, self._coded = 2 * depth, gray
        self._words: list[int] = [0] * depth
        self._write, self._read = _Pointer(gray), _Pointer(gray)
        self._at_read, self._at_write = [0, 0], [0, 0]  # two flip-flops each way
        self._coin = Coin(seed, 1)

    def _seen(self, code: int) -> int:
        return ungray(code) if self._coded else code

    @property
    def room_taken(self) -> int:
        """Number of words as the writer sees it: never less than the true number."""
        return (self._write.number - self._seen(self._at_write[1])) % self._wrap

    @property
    def waiting(self) -> int:
        """Number of words as the reader sees it: never more than the true number."""
        return (self._seen(self._at_read[1]) - self._read.number) % self._wrap

    @property
    def inside(self) -> int:
        """True number of words, which neither side of the hardware knows."""
        return self._write.number - self._read.number

    @property
    def full(self) -> bool:
        """Full, as the writer sees it."""
        return self.room_taken >= self.depth

    @property
    def prog_full(self) -> bool:
        """Nearly full, as the writer sees it."""
        return self.room_taken >= self.prog_full_at

    @property
    def empty(self) -> bool:
        """Empty, as the reader sees it."""
        return self.waiting == 0

    @property
    def prog_empty(self) -> bool:
        """Nearly empty, as the reader sees it."""
        return self.waiting < self.prog_empty_at

    @property
    def front(self) -> int:
        """The word that the next read returns."""
        return self._words[self._read.number % self.depth]

    def write_edge(self, now: int, word: int | None = None) -> bool:
        """An edge of the write clock, with a word to write or None; True if the word was stored."""
        took = word is not None and not self.full
        if word is not None and not took:
            self.overflows += 1
        sample = self._read.sampled(now, self.window, self._coin)
        self._at_write = [sample, self._at_write[0]]
        if took and word is not None:
            self._words[self._write.number % self.depth] = word
            self._write.advance(now, self._wrap)
            self.most = max(self.most, self.inside)
        return took

    def read_edge(self, now: int, rd_en: bool = False) -> int | None:
        """An edge of the read clock; returns the word that was read, or None."""
        took = None
        if rd_en:
            if self.empty:
                self.underflows += 1
            else:
                took = self.front
        sample = self._write.sampled(now, self.window, self._coin)
        self._at_read = [sample, self._at_read[0]]
        if took is not None:
            self._read.advance(now, self._wrap)
        return took


class Packer:
    """Packs narrow values into words, the first in the lowest bits (assumed, as is the order in
    memory)."""

    def __init__(self, narrow: int = 16, wide: int = 128) -> None:
        if narrow <= 0 or wide % narrow:
            raise ValueError("the wide width must be a multiple of the narrow one")
        self.narrow, self.count = narrow, wide // narrow
        self._word = self._held = 0

    def push(self, value: int, last: bool = False) -> int | None:
        """A word when it is full or after the last value (other bits zero), else None."""
        self._word |= value << self.narrow * self._held
        self._held += 1
        if self._held < self.count and not last:
            return None
        word, self._word, self._held = self._word, 0, 0
        return word


class Unpacker:
    """The inverse of `Packer`."""

    def __init__(self, narrow: int = 16, wide: int = 128) -> None:
        if narrow <= 0 or wide % narrow:
            raise ValueError("the wide width must be a multiple of the narrow one")
        self.narrow, self.count = narrow, wide // narrow
        self._word = self._left = 0

    @property
    def wants(self) -> bool:
        """Whether the next `take` needs a new word."""
        return self._left == 0

    def load(self, word: int) -> None:
        """Loads a word; remaining values of the last word are discarded."""
        self._word, self._left = word, self.count

    def take(self) -> int:
        """The next value; ValueError if a word must be loaded first."""
        if not self._left:
            raise ValueError("nothing is left of the word")
        value = self._word & (1 << self.narrow) - 1
        self._word >>= self.narrow
        self._left -= 1
        return value
