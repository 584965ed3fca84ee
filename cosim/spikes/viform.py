"""`Viform`: spike planes as bits, packed pixel by pixel, and the protocol of streams of them.

A word has 32 consecutive latch cycles of one pixel, least significant bit first: bit b of
words[w, i, j] is pixel (i, j) in cycle 32 w + b. The kernels of a chip write these words, and the
shaders of a display read them. Plane-major bytes exist only in files that require them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.errors import InputError

WORD = 32
"""Latch cycles in a word."""
_SHOWN: Final = 1000
"""Longer side of the picture of a stream, pixels."""
_COUNTED: Final = 4096
"""Cycles whose spikes such a picture counts."""
Words = npt.NDArray[np.uint32]
"""(words, height, width) uint32."""


def words_for(cycles: int) -> int:
    """Words that hold `cycles` latch cycles."""
    return -(-cycles // WORD)


def cut_words(words: Words, first: int, stop: int) -> Words:
    """Cycles `first` to `stop` of words, (n, ...), from bit 0 on; bits beyond are 0. A view of them
    where these are whole words."""
    (at, shift), count = divmod(first, WORD), words_for(stop - first)
    out = words[at : at + count]
    if shift:
        out, above = out >> np.uint32(shift), words[at + 1 : at + 1 + count]
        out[: len(above)] |= above << np.uint32(WORD - shift)
    if (stop - first) % WORD:
        out = out if shift else out.copy()
        out[-1] &= _mask(0, stop - first, count - 1)
    return out


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
    for t in range(first, stop):
        if t == first or t % 8 == 0:  # bytes, which are shifted in less time than words
            byte = (words[t // WORD] >> np.uint32(t // 8 * 8 % WORD)).astype(np.uint8)
        plane = np.right_shift(byte, np.uint8(t % 8), out=planes[t - first])
        plane &= 1
    return planes


def _mask(first: int, stop: int, w: int) -> np.uint32:
    """Bits of word w that belong to cycles first to stop."""
    low, high = max(first - w * WORD, 0), min(stop - w * WORD, WORD)
    return np.uint32(((1 << high) - 1) & ~((1 << low) - 1))


def spikes_beyond(last: npt.NDArray[np.uint32], cycles: int) -> bool:
    """Whether the last words of `cycles` cycles have bits set beyond the last cycle."""
    return bool(cycles % WORD and last.size and int(last.max()) >> cycles % WORD)


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


class Sliceable:
    """Adds to a stream: parts of itself, text, and its picture in a notebook.

    stream[first:stop] are cycles, counted from the first of the stream; stream[cycles, rows,
    columns] are pixels as well. Parts are in memory.
    """

    __iter__ = None  # parts are asked for, not gone through

    def __getitem__(self: SpikeStream, part: Any) -> Viform:
        parts = part if isinstance(part, tuple) else (part,)
        if len(parts) > 3:
            raise InputError("a part", "cycles, rows, columns", f"{len(parts)}", "leave some out")
        return part_of(self, *parts)

    def __len__(self: SpikeStream) -> int:
        return self.cycles

    def between(self: SpikeStream, start_s: float, stop_s: float) -> Viform:
        """The cycles that begin from `start_s` until `stop_s`, s after the first latch; times
        before the first cycle or after the last are taken as those. Raises InputError if no cycle
        begins in between."""
        if start_s < stop_s:  # neither is NaN
            ends = (min(max(at * self.clock.hz, 0), self.cycles) for at in (start_s, stop_s))
            first, stop = map(round, ends)
            if first < stop:
                return part_of(self, slice(first, stop))
        raise InputError(
            "times", f"a part of 0 to {self.cycles / self.clock.hz:g} s of a cycle or more",
            f"{start_s:g} to {stop_s:g} s", "change them",
        )  # fmt: skip

    def planes(self: SpikeStream) -> npt.NDArray[np.uint8]:
        """(T, H, W) uint8 of 0 and 1, in memory."""
        return unpack_planes(self.read_words(0, words_for(self.cycles)), 0, self.cycles)

    def rate(self: SpikeStream) -> npt.NDArray[np.float32]:
        """Mean spikes a cycle, (H, W) float32."""
        return (count_spikes(self, 0, self.cycles) / np.float32(self.cycles)).astype(np.float32)

    def __repr__(self: SpikeStream) -> str:
        height, width = self.shape
        return (
            f"{type(self).__name__}: {self.cycles} cycles at {self.clock.hz / 1e3:g} kHz "
            f"({1e3 * self.cycles / self.clock.hz:g} ms), {width} x {height} pixels"
        )

    def _repr_png_(self: SpikeStream) -> bytes:
        """The mean rate of the cycles in the middle, its square root for the eye."""
        import cv2

        some = min(self.cycles, _COUNTED)
        first = (self.cycles - some) // 2
        rate = count_spikes(self, first, first + some) / np.float32(some)
        step = -(-max(self.shape) // _SHOWN)
        white = float(np.quantile(rate, 0.999)) or 1.0
        grey = np.sqrt(np.clip(rate[::step, ::step] / white, 0, 1))
        return bytes(cv2.imencode(".png", np.rint(255 * grey).astype(np.uint8))[1])


def part_of(
    stream: SpikeStream, cycles: Any = slice(None), rows: Any = slice(None),
    columns: Any = slice(None),
) -> Viform:  # fmt: skip
    """A part of a stream, in memory.

    Args:
        stream: the stream.
        cycles, rows, columns: slices without a step, or an index; negative ones count from the end.

    Returns:
        The part; its `start` is the number of its first cycle on the stream's clock. It has what
        the source of the stream says beyond its spikes in these cycles, with the registers that
        hold in the first one.

    Raises:
        InputError: a slice with a step, or a part without an element.
    """
    first, stop = _bounds("cycles", cycles, stream.cycles)
    top, bottom = _bounds("rows", rows, stream.shape[0])
    left, right = _bounds("columns", columns, stream.shape[1])
    word, shift = divmod(first, WORD)
    read = stream.read_words(word, words_for(stop))[:, top:bottom, left:right]
    words = np.ascontiguousarray(cut_words(read, shift, shift + stop - first))
    if np.may_share_memory(words, read):
        words = words.copy()
    start = getattr(stream, "start", 0) + first
    said = _said(getattr(stream, "ancillary", ()), start, start + stop - first)
    parts = tuple(each.part((top, bottom), (left, right)) for each in said)
    return Viform(words, stop - first, stream.clock, start, parts)


def _said(several: Sequence[Any], first: int, stop: int) -> list[Any]:
    """Ancillary data of cycles `first` to `stop`, with what holds in the first one."""
    within = [each for each in several if first <= each.cycle < stop]
    before = [each for each in several if each.lasting and each.cycle < first]
    if before and not any(each.lasting and each.cycle == first for each in within):
        within.insert(0, replace(before[-1], cycle=first))
    return within


def _bounds(name: str, given: Any, size: int) -> tuple[int, int]:
    """First and stop of a slice or an index in `size` elements."""
    part = given
    if isinstance(given, (int, np.integer)):
        at = int(given) + (size if given < 0 else 0)
        part = slice(max(at, 0), max(at + 1, 0))
    if not isinstance(part, slice) or part.step not in (None, 1):
        raise InputError(
            name, "a slice without a step, or an index", repr(given), "write first:stop"
        )
    first, stop, _ = part.indices(size)
    if stop <= first:
        text = f"{part.start}:{part.stop}".replace("None", "")
        raise InputError(
            name,
            f"a part of 0:{size}",
            text if part is given else repr(given),
            f"write first:stop with 0 <= first < stop <= {size}",
        )
    return first, stop


@dataclass(frozen=True, eq=False, repr=False)
class Viform(Sliceable):
    """Spike planes in memory.

    Attributes:
        words: (ceil(cycles / 32), H, W) uint32.
        cycles: number of latch cycles.
        clock: clock of the latches.
        start: number of the first cycle.
        ancillary: what the source says beyond the spikes, `cosim.spikes.ancillary`, in the order of
            their cycles; these lie within the planes.

    Raises:
        ValueError: the words have another shape or type, or spikes beyond the last cycle.
    """

    words: Words
    cycles: int
    clock: Clock
    start: int = 0
    ancillary: tuple[Any, ...] = ()

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
    def from_planes(cls, planes: npt.NDArray[Any], clock: Clock) -> Viform:
        """A viform from (T, H, W) planes of 0 and 1, starting at cycle 0. Raises InputError for
        other planes."""
        given: npt.NDArray[Any] = np.asarray(planes)
        if given.ndim != 3 or not given.size or given.dtype not in (np.bool_, np.uint8):
            text = f"{given.shape} {given.dtype}"
            raise InputError("planes", "(T, H, W) bool or uint8", text, "convert them")
        if given.max() > 1:
            text = f"values up to {given.max()}"
            raise InputError("planes", "0 or 1, a spike", text, "film frames by a Camera")
        return cls(pack_planes(given), len(given), clock)

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self.words.shape[1], self.words.shape[2]

    def read_words(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded), as a view; see `SpikeStream`."""
        return self.words[first:stop]

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
