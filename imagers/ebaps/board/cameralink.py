"""Camera Link, base configuration, one tap of 16 bits: the video output of the EBAPS board.

Document 002, section 2: 28 parallel bits and a clock become five serial channels, at 85 MHz. Of the
28 (Camera Link specification, TxIN numbers of the channel link chip) 24 are the ports A, B and C,
three are FVAL, LVAL and DVAL, one is spare. Grey of 16 bits takes A (low byte) and B (high); C is
tied to 0. Four pairs carry seven bits each per clock. The fifth carries the clock as 1100011, from
which the receiver finds the start of a word. Bit order within the pairs is that of channel link
chips' data sheets (DS90CR287); the document prints none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from imagers.ebaps.board.timing import FRAME_RATE, Timing

LINK_HZ = 85_000_000
"""Clock, Hz: document 002, section 2."""
PORTS = (
    (0, 1, 2, 3, 4, 6, 27, 5),
    (7, 8, 9, 12, 13, 14, 10, 11),
    (15, 18, 19, 20, 21, 22, 16, 17),
)
"""TxIN number of bits 0 to 7 of the ports A, B and C: Camera Link specification."""
SPARE, LVAL, FVAL, DVAL = 23, 24, 25, 26
"""TxIN numbers of the other four: Camera Link specification."""
PAIRS = (
    (7, 6, 4, 3, 2, 1, 0),
    (18, 15, 14, 13, 12, 9, 8),
    (26, 25, 24, 22, 21, 20, 19),
    (23, 17, 16, 11, 10, 5, 27),
)
"""TxIN numbers that each data pair carries in a clock, first to last."""
CLOCK_PATTERN = (1, 1, 0, 0, 0, 1, 1)
"""The clock pair in the same seven places."""
SERIAL_BITS = len(CLOCK_PATTERN)
"""Bits of a channel in one clock."""
WORD_BITS = sum(map(len, PAIRS))
"""Parallel bits: 28, as document 002 prints."""
CHANNELS = len(PAIRS) + 1
"""Serial channels, the clock's among them: 5, as document 002 prints."""

Words = npt.NDArray[np.uint32]
Image = npt.NDArray[np.uint16]
Bits = npt.NDArray[np.uint8]

_BYTES = [np.zeros(256, np.uint32) for _ in PORTS]
for _table, _port in zip(_BYTES, PORTS, strict=True):
    for _bit, _place in enumerate(_port):
        _table |= (np.arange(256, dtype=np.uint32) >> _bit & 1) << np.uint32(_place)


@dataclass(frozen=True)
class LinkTiming:
    """One tap.

    All lines of a frame have the same number of clocks, the largest that fits; the remaining clocks
    follow the last line (assumed: the document prints no blanking).

    Attributes:
        columns, rows: size of a frame.
        clock_hz: clock of the link.
        rate: frames a second.
    """

    columns: int = Timing().columns
    rows: int = Timing().rows
    clock_hz: int = LINK_HZ
    rate: int = FRAME_RATE

    def __post_init__(self) -> None:
        if min(self.columns, self.rows, self.clock_hz, self.rate) <= 0:
            raise ValueError("columns, rows, clock and rate must be above 0")
        if self.line_blank < 1:
            raise ValueError("a line needs a clock of blanking at least, for LVAL to fall")

    @property
    def pixel_rate(self) -> int:
        """Pixels a second: 39 321 600."""
        return self.columns * self.rows * self.rate

    @property
    def utilisation(self) -> float:
        """Share of clocks that carry a pixel: 46 % at 85 MHz."""
        return float(Fraction(self.pixel_rate, self.clock_hz))

    @property
    def bits_per_second(self) -> int:
        """All 28 parallel bits: 2.38 Gbit/s at 85 MHz."""
        return WORD_BITS * self.clock_hz

    @property
    def pair_rate(self) -> int:
        """Bits a second on one pair: 595 Mbit/s at 85 MHz."""
        return SERIAL_BITS * self.clock_hz

    @property
    def line_clocks(self) -> int:
        """Clocks of a line, blanking included."""
        return self.clock_hz // self.rate // self.rows

    @property
    def line_blank(self) -> int:
        """Clocks of a line with LVAL low."""
        return self.line_clocks - self.columns

    def frame_start(self, frame: int) -> int:
        """Clock at which a frame's FVAL rises."""
        return frame * self.clock_hz // self.rate

    def frame_blank(self, frame: int) -> int:
        """Clocks with FVAL low at the end of a frame's period."""
        period = self.frame_start(frame + 1) - self.frame_start(frame)
        return period - self.rows * self.line_clocks + self.line_blank


def words_of(pixels: Image) -> Words:
    """The 28 TxIN bits of pixels, of any shape: FVAL, LVAL and DVAL high, bit n is TxIN n."""
    control = np.uint32(1 << FVAL | 1 << LVAL | 1 << DVAL)
    return _BYTES[0][pixels & 0xFF] | _BYTES[1][pixels >> 8] | control


def pixels_of(words: Words) -> Image:
    """Pixels from the ports A and B of words; the inverse of `words_of`."""
    pixels = np.zeros(words.shape, np.uint32)
    for bit, place in enumerate(PORTS[0] + PORTS[1]):
        pixels |= (words >> np.uint32(place) & np.uint32(1)) << np.uint32(bit)
    return pixels.astype(np.uint16)


def frame_words(image: Image, timing: LinkTiming, frame: int = 0) -> Iterator[Words]:
    """The words of a frame period: line by line, then the words with FVAL low."""
    if image.shape != (timing.rows, timing.columns):
        raise ValueError(f"a frame must be {timing.rows} x {timing.columns}, not {image.shape}")
    line = np.zeros(timing.line_clocks, np.uint32)
    line[timing.columns :] = 1 << FVAL
    for n, row in enumerate(image):
        line[: timing.columns] = words_of(row)
        yield line.copy() if n < timing.rows - 1 else line[: timing.columns].copy()
    yield np.zeros(timing.frame_blank(frame), np.uint32)


def serialise(words: Words) -> Bits:
    """(5, 7 n) bits of n words, in time order; the last row is the clock pair."""
    found = np.empty((CHANNELS, words.size, SERIAL_BITS), np.uint8)
    for pair, places in enumerate(PAIRS):
        for slot, place in enumerate(places):
            found[pair, :, slot] = words >> np.uint32(place) & np.uint32(1)
    found[-1] = CLOCK_PATTERN
    return found.reshape(CHANNELS, -1)


def deserialise(bits: npt.ArrayLike) -> Words:
    """The whole words in five channels of bits, which may begin and end within a word.

    The clock pair gives the start of words. InputError if its pattern is violated anywhere, or if
    the array is not five rows of 0 and 1 of at least one word.
    """
    given = np.asarray(bits)
    if given.ndim != 2 or given.shape[0] != CHANNELS or given.dtype.kind not in "bui":
        raise InputError(
            "a Camera Link recording", f"{CHANNELS} rows of 0 and 1",
            f"{given.dtype} of shape {given.shape}", "record all channels",
        )  # fmt: skip
    if given.size and (given.min() < 0 or given.max() > 1):
        raise InputError(
            "a Camera Link bit", "0 or 1", f"{given.max() if given.max() > 1 else given.min()}",
            "slice the pairs' levels first",
        )  # fmt: skip
    begin = _aligned(given[-1])
    count = (given.shape[1] - begin) // SERIAL_BITS
    whole = given[:, begin : begin + count * SERIAL_BITS].reshape(CHANNELS, count, SERIAL_BITS)
    words = np.zeros(count, np.uint32)
    for pair, places in enumerate(PAIRS):
        for slot, place in enumerate(places):
            words |= whole[pair, :, slot].astype(np.uint32) << np.uint32(place)
    return words


def _aligned(clock: npt.NDArray[np.generic]) -> int:
    """Index of the first whole word; the whole clock pair must agree, partial words at both ends
    included."""
    pattern = np.array(CLOCK_PATTERN)
    if clock.size >= SERIAL_BITS:
        for begin in range(SERIAL_BITS):
            wanted = np.resize(np.roll(pattern, begin), clock.size)
            if np.array_equal(wanted, clock) and clock.size >= begin + SERIAL_BITS:
                return begin
    raise InputError(
        "the clock pair of a Camera Link recording",
        f"{''.join(map(str, CLOCK_PATTERN))} again and again, for a whole word at least",
        f"{clock.size} bits that are not", "check the receiver's lock",
    )  # fmt: skip


def read_frames(
    parts: Sequence[Words] | Iterator[Words], columns: int, rows: int
) -> Iterator[Image]:
    """(rows, columns) frames in a sequence of words that begins and ends anywhere.

    A frame is one interval with FVAL high, a line one interval with LVAL high, a pixel one word
    with DVAL high. An incomplete frame at the beginning or the end is not returned. InputError for
    lines or frames of another length.
    """
    lines: list[Words] = []
    line: list[Words] = []
    locked, number, was = False, 0, 0
    for words in parts:
        frame = (words >> np.uint32(FVAL) & 1).astype(np.int8)
        valid = frame & (words >> np.uint32(LVAL) & 1).astype(np.int8)
        state = frame + valid  # 0 between frames, 1 between lines, 2 in a line
        edges = np.flatnonzero(np.diff(state)) + 1
        for run in np.split(np.arange(words.size), edges):
            if not run.size:
                continue
            now = int(state[run[0]])
            if was == 2 and now < 2 and locked:
                lines.append(_line(line, columns, number, len(lines)))
                line = []
            if now == 0:
                if was and locked:
                    yield _frame(lines, columns, rows, number)
                    number += 1
                lines, locked = [], True
            elif now == 2 and locked:
                there = words[run[0] : run[-1] + 1]
                line.append(there[(there >> np.uint32(DVAL) & 1).astype(bool)])
            was = now


def _line(parts: list[Words], columns: int, frame: int, number: int) -> Words:
    line = np.concatenate(parts)
    if line.size != columns:
        raise InputError(
            f"line {number} of Camera Link frame {frame}", f"{columns} pixels", f"{line.size}",
            "name the size that the camera sends",
        )  # fmt: skip
    return line


def _frame(lines: list[Words], columns: int, rows: int, frame: int) -> Image:
    if len(lines) != rows:
        raise InputError(
            f"Camera Link frame {frame}", f"{rows} lines", f"{len(lines)}",
            "name the size that the camera sends",
        )  # fmt: skip
    return pixels_of(np.concatenate(lines)).reshape(rows, columns)
