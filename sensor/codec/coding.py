"""Streams to frames of first spikes and back, in chunks of cycles and bands of pixels, or whole.

The state of each pixel is carried from chunk to chunk, so that a stream of any length is coded in
bounded memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from cosim import Clock, SpikeStream, Viform
from cosim.compute.cores import cores
from cosim.compute.memory import check_memory
from cosim.compute.stopping import threads
from cosim.spikes.viform import WORD, Words, words_for
from sensor.codec.columns import Column, Damaged, pack_column, unpack_column, values_in
from sensor.codec.follow import (
    FOLLOW_STATE,
    SPACED_CARRY,
    close_spaced,
    follow,
    from_spaced,
    to_spaced,
)
from sensor.codec.law import effective_q
from sensor.codec.line import LINE_CARRY, LINE_COLUMNS, LINE_STATE, from_line, lines, to_line

CODES: Final = ("line", "repeat", "statistical")
CHUNK: Final = 16
"""Words in a chunk, 512 cycles."""
BAND: Final = 16_384
"""Pixels in a band, in raster order."""
LONGEST: Final = 2**31 - 64
"""Cycles that the state of a pixel can count."""
MOST_REFINE: Final = 255


@dataclass(frozen=True)
class Code:
    """A code and its settings. Raises ValueError for settings out of range.

    Attributes:
        name: `line` and `repeat` are lossless; `statistical` sends changes beyond `k` standard
            deviations of a width.
        k: parameter k of the statistical code.
        threshold, threshold_noise: threshold and noise of the pixel that the widths come from,
            electrons.
        refine: widths in the mean that is sent after a change; 0 for none (the rule of the paper).
    """

    name: Literal["line", "repeat", "statistical"]
    k: float = 0.0
    threshold: float = 0.0
    threshold_noise: float = 0.0
    refine: int = 0

    def __post_init__(self) -> None:
        if self.name not in CODES:
            raise ValueError(f"code must be one of {', '.join(CODES)}, not {self.name!r}")
        if self.lossless:
            if (self.k, self.threshold, self.threshold_noise, self.refine) != (0, 0, 0, 0):
                raise ValueError(f"the code {self.name} must stand without settings")
            return
        if not 0 < self.k <= 1000:
            raise ValueError(f"k must be above 0 and at most 1000, not {self.k:g}")
        if not 1e-3 <= self.threshold <= 1e9:
            raise ValueError(f"threshold must be 1e-3 to 1e9 e, not {self.threshold:g} e")
        if not 0 <= self.threshold_noise <= self.threshold:
            raise ValueError(f"threshold noise must be 0 to the threshold, "
                             f"not {self.threshold_noise:g} e")  # fmt: skip
        if self.refine != 0 and not 2 <= self.refine <= MOST_REFINE:
            raise ValueError(f"refine must be 0, or 2 to {MOST_REFINE}, not {self.refine}")

    @property
    def lossless(self) -> bool:
        return self.name != "statistical"

    @property
    def rsd2(self) -> float:
        """Square of the relative standard deviation of an interval."""
        return 0.0 if self.lossless else 1 / effective_q(self.threshold, self.threshold_noise)


@dataclass(frozen=True)
class Frame:
    """One band in one chunk.

    Attributes:
        events: first spikes in it, closing ones included.
    """

    events: int
    data: bytes


def encode(stream: SpikeStream, code: Code, level: int | None = 3) -> Iterator[Frame]:
    """Yields the frames of a stream, chunk by chunk and, in a chunk, band by band.

    level: zstd level, used where it makes a column smaller; None uses Exp-Golomb codes only.
    Raises ValueError for a stream of more than LONGEST cycles.
    """
    if stream.cycles > LONGEST:
        raise ValueError(f"a coded stream must have at most {LONGEST} cycles, not {stream.cycles}")
    bands = _bands(stream.shape[0] * stream.shape[1])
    coders = [_Band(code, high - low, stream.cycles) for low, high in bands]
    total = words_for(stream.cycles)
    with threads(workers()) as pool:
        for first in range(0, total, CHUNK):
            words = stream.read_words(first, min(first + CHUNK, total))
            flat = words.reshape(len(words), -1)
            jobs = [
                pool.submit(coder.encode, flat[:, low:high], first * WORD, level)
                for coder, (low, high) in zip(coders, bands, strict=True)
            ]
            for job in jobs:
                yield job.result()


def encode_band(code: Code, words: Words, cycles: int, level: int | None = 3) -> Frame:
    """(n, pixels) words, of at most CHUNK words and BAND pixels, as a stream of their own."""
    return _Band(code, words.shape[1], cycles).encode(words, 0, level)


def decode(
    code: Code, frames: Sequence[memoryview], shape: tuple[int, int], cycles: int, clock: Clock,
    start: int = 0, name: str = "the coded stream",
) -> Viform:  # fmt: skip
    """The stream of all its frames, in the order of `encode`. name: of what they are, for messages.

    Raises Damaged, and InputError where memory is short, before it is taken.
    """
    pixels, bands = shape[0] * shape[1], frame_count(shape, cycles)[1]
    ends = [(band * BAND, min((band + 1) * BAND, pixels)) for band in range(bands)]
    rooms = [band_memory(frames[b::bands], ends[b][1] - ends[b][0], cycles) for b in range(bands)]
    need = 4 * words_for(cycles) * pixels + sum(sorted(rooms)[-workers() :])
    check_memory(f"{name} in memory", need, "code it in shorter pieces")
    words: Words = np.zeros((words_for(cycles), pixels), np.uint32)

    def draw(band: int) -> None:
        low, high = ends[band]
        words[:, low:high] = decode_band(code, frames[band::bands], high - low, cycles)

    with threads(workers()) as pool:
        list(pool.map(draw, range(bands)))
    return Viform(words.reshape(-1, *shape), cycles, clock, start)


def decode_band(code: Code, frames: Sequence[memoryview], pixels: int, cycles: int) -> Words:
    """Words (n, pixels) of one band from its frames, one per chunk in order. Raises Damaged."""
    across: Any = np.zeros((pixels, words_for(cycles)), np.uint32)
    carry = _carry(code, pixels)
    most = _most(pixels)
    for data in frames:
        if code.name == "line":
            columns = _columns(data, LINE_COLUMNS, most)
            if len({len(c) for c in columns[:3]}) > 1:
                raise Damaged("columns of different lengths")
            place, gap, spikes, width, bend, rest, phase = columns
            good = from_line(place, gap, spikes, width, bend, rest, phase, carry, across, cycles)
        else:
            columns = _columns(data, 4 if code.refine else 3, most)
            if len({len(c) for c in columns}) > 1:
                raise Damaged("columns of different lengths")
            if not code.refine:
                columns.append(np.zeros(len(columns[0]), np.uint32))
            good = from_spaced(np.stack(columns), code.lossless, code.refine, carry, across, cycles)
        if not good:
            raise Damaged("first spikes that cannot be")
    if code.name != "line":
        close_spaced(carry, across, cycles)
    return np.ascontiguousarray(across.T)


def recode(stream: SpikeStream, code: Code) -> Viform:
    """A stream coded and decoded again."""
    frames = [memoryview(frame.data) for frame in encode(stream, code, None)]
    start = int(getattr(stream, "start", 0))
    return decode(code, frames, stream.shape, stream.cycles, stream.clock, start)


def frame_count(shape: tuple[int, int], cycles: int) -> tuple[int, int]:
    """(chunks, bands) of a stream."""
    return -(-words_for(cycles) // CHUNK), -(-shape[0] * shape[1] // BAND)


def band_memory(frames: Sequence[memoryview], pixels: int, cycles: int) -> int:
    """Upper bound of the memory that `decode_band` needs, bytes.

    The bound counts the planes twice. For the largest frame it counts the values of its columns,
    their copy in one table, and up to 5 bytes per value that zstd returns.
    """
    values = max((values_in(data, _most(pixels)) for data in frames), default=0)
    return 2 * 4 * words_for(cycles) * pixels + (4 + 4 + 5) * values


def workers() -> int:
    """Number of threads over bands; the compiled loops and zstd release the interpreter lock."""
    return min(cores(), 16)


class _Band:
    """The coder of one band's pixels."""

    def __init__(self, code: Code, pixels: int, cycles: int) -> None:
        self._code, self._cycles = code, cycles
        line = code.name == "line"
        self._state = np.zeros((pixels, LINE_STATE if line else FOLLOW_STATE), np.int32)
        self._carry = _carry(code, pixels)
        if not line:
            self._state[:, 0], self._state[:, 2] = -1, 1

    def encode(self, words: Words, first: int, level: int | None) -> Frame:
        """words: (n, pixels), whose first bit is cycle `first`."""
        code, across = self._code, np.ascontiguousarray(words.T)
        room = int(np.bitwise_count(across).sum(dtype=np.int64)) + len(across)
        columns: Sequence[Column]
        if code.name == "line":
            records = np.empty((6, room), np.int32)
            n = lines(across, first, self._cycles, self._state, records)
            table = np.empty((LINE_COLUMNS, n), np.uint32)
            wide, bent, broken = to_line(records[:, :n], self._carry, table)
            lengths = (n, n, n, wide, bent, broken, broken)
            columns = [row[:length] for row, length in zip(table, lengths, strict=True)]
        else:
            records = np.empty((4, room), np.int32)
            n = follow(
                across, first, self._cycles, self._state, code.rsd2, code.k, code.refine, records
            )
            table = np.empty((4, n), np.uint32)
            found = np.ascontiguousarray(records[:, :n])  # one layout, for which it is compiled
            to_spaced(found, code.lossless, code.refine, self._carry, table)
            columns = list(table[: 4 if code.refine else 3])
        return Frame(n, b"".join(pack_column(column, level) for column in columns))


def _carry(code: Code, pixels: int) -> npt.NDArray[np.int32]:
    """State that the first record of each pixel is coded against: a spike at cycle -1."""
    carry = np.zeros((pixels, LINE_CARRY if code.name == "line" else SPACED_CARRY), np.int32)
    carry[:, 0] = -1
    if code.name != "line":
        carry[:, 2] = 1
    return carry


def _bands(pixels: int) -> list[tuple[int, int]]:
    return [(low, min(low + BAND, pixels)) for low in range(0, pixels, BAND)]


def _columns(data: memoryview, count: int, most: int) -> list[Column]:
    columns = []
    for _ in range(count):
        column, data = unpack_column(data, most)
        columns.append(column)
    if len(data):
        raise Damaged("bytes after the last column")
    return columns


def _most(pixels: int) -> int:
    """Largest length of a frame's column: one spike per cycle, and one closing spike, per pixel."""
    return pixels * (CHUNK * WORD + 1)
