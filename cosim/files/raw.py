"""`.raw`: words of a SpikeTwo-class camera, 1000 x 1000, 128 000 bytes a frame, with markers.

A frame is 2000 blocks of 64 bytes, each half a row: bits 0 to 499 are pixels from left to right,
least significant bit first, bits 500 to 511 a marker. The last 16 bits of a block, little-endian,
hold line = (w >> 4) & 0x3ff, 1 to 500, and channel = w >> 14, 0 to 3. A frame starts with the block
(channel 0, line 500) that follows (channel 3, line 500).

A capture may start and stop within a frame, so the reader searches for whole frames. It checks all
markers, because a lost block would shift all following ones.
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.atomic import atomic_write
from cosim.spikes.viform import WORD, SpikeStream, Words, pack_planes, unpack_planes, words_for

RAW_CLOCK = Clock(40_000)
"""Clock of the chip, which the file does not contain."""
Bytes = npt.NDArray[np.uint8]
RAW_SIZE = (1000, 1000)
"""Width and height of the pixels."""
BLOCK_BYTES = 64
BLOCKS = 2000
FRAME_BYTES = BLOCKS * BLOCK_BYTES
HALF = RAW_SIZE[0] // 2
"""Pixels in a block."""
MARKER_MASK = 0xFFF0
"""Bits of a block's last 16 that are its marker; the four below are pixels 496 to 499."""


class Table(NamedTuple):
    """Properties of the blocks of a frame, in the order of the file; each (2000,) int.

    Attributes:
        channel, line: numbers in the marker of the block.
        row: row of the chip.
        half: 0 for the left half of the row, 1 for the right.
    """

    channel: npt.NDArray[np.intp]
    line: npt.NDArray[np.intp]
    row: npt.NDArray[np.intp]
    half: npt.NDArray[np.intp]


def _chip_map() -> Table:
    """Position of each block on the chip.

    The map is not published; this is the simplest one that agrees with public readers. They read a
    frame from (channel 0, line 500) on as rows of two blocks, left and right, from the top row
    down. The block before is (channel 3, line 500). As a frame begins and ends with lines 500,
    lines count outwards from the middle of the chip in four quadrants: channels 0 and 1 are upper
    left and right, 2 and 3 lower left and right.
    """
    row, half = np.divmod(np.arange(BLOCKS), 2)
    lower = row >= RAW_SIZE[1] // 2
    line = np.where(lower, row - RAW_SIZE[1] // 2 + 1, RAW_SIZE[1] // 2 - row)
    return Table(2 * lower + half, line, row, half)


TABLE = _chip_map()


def markers(table: Table = TABLE) -> npt.NDArray[np.uint16]:
    """The marker of each block of a frame, within its last 16 bits, (2000,) uint16."""
    return (table.channel << 14 | table.line << 4).astype(np.uint16)


_MARKERS = markers()
_PLACE = TABLE.row * 2 + TABLE.half
"""Index of the half row of the chip of each block of a frame."""


def _markers_of(data: Bytes, first: int, count: int) -> npt.NDArray[np.uint16]:
    """Markers of `count` blocks from byte `first` on."""
    blocks = data[first : first + count * BLOCK_BYTES].reshape(count, BLOCK_BYTES)
    low, high = (blocks[:, n].astype(np.uint16) for n in (-2, -1))
    return (low | high << np.uint16(8)) & np.uint16(MARKER_MASK)


def _frame_start(data: Bytes) -> int | None:
    """The byte, within the length of a frame, at which the most markers of a frame are correct.

    None if fewer than half of them are: the file is not of this format.
    """
    last = min(len(data) - FRAME_BYTES, FRAME_BYTES)
    low = data[BLOCK_BYTES - 2 : BLOCK_BYTES - 1 + last].astype(np.uint16)
    high = data[BLOCK_BYTES - 1 : BLOCK_BYTES + last].astype(np.uint16)
    best, place = BLOCKS // 2 - 1, None
    for byte in np.flatnonzero((low | high << 8) & MARKER_MASK == _MARKERS[0]):
        right = int((_markers_of(data, int(byte), BLOCKS) == _MARKERS).sum())
        if right > best:
            best, place = right, int(byte)
        if right == BLOCKS:
            break
    return place


class RawStream:
    """A `.raw` file as a spike stream. Frames are read, and their markers checked, on demand.
    Opening checks the first and the last frame, and the data before and after them.

    Attributes:
        notes: numbers of bytes before the first whole frame and after the last, which are ignored.

    Raises:
        InputError: the file has no whole frame, or blocks are lost or damaged.
    """

    shape = RAW_SIZE[::-1]
    clock = RAW_CLOCK

    def __init__(self, path: Path) -> None:
        self._path = path
        length = path.stat().st_size
        must = f"1000x1000 raw words with a whole frame of {FRAME_BYTES} bytes"
        if length < FRAME_BYTES:
            raise InputError(f"{path}", must, f"{length} bytes", "take a longer capture")
        self._data: Bytes = np.asarray(np.memmap(path, np.uint8, "r"))
        start = _frame_start(self._data)
        if start is None:
            value = "one without the markers of a frame"
            raise InputError(f"{path}", must, value, "name a stream without markers .dat")
        self._start = start
        self.cycles, rest = divmod(length - start, FRAME_BYTES)
        lead = start // BLOCK_BYTES
        wrong = _markers_of(self._data, start % BLOCK_BYTES, lead) != _MARKERS[BLOCKS - lead :]
        if wrong.any():
            self._refuse_lead(start % BLOCK_BYTES + int(wrong.nonzero()[0][-1]) * BLOCK_BYTES)
        self._check(0, 1)
        self._check(self.cycles - 1, self.cycles)
        tail = rest // BLOCK_BYTES
        if (_markers_of(self._data, length - rest, tail) != _MARKERS[:tail]).any():
            self._refuse()
        ignored = [f"{start} before the first whole frame"] if start else []
        ignored += [f"{rest} after the last"] if rest else []
        self.notes = (f"bytes of {path} left out: {', '.join(ignored)}",) if ignored else ()

    def _check(self, first: int, stop: int) -> None:
        """Checks the markers of frames `first` to `stop` (excluded)."""
        markers = _markers_of(
            self._data, self._start + first * FRAME_BYTES, (stop - first) * BLOCKS
        )
        if (markers.reshape(-1, BLOCKS) != _MARKERS).any():
            self._refuse()

    def _refuse(self) -> None:
        """Raises InputError with the first wrong block of the file, which may be the cause of
        others."""
        blocks = (len(self._data) - self._start) // BLOCK_BYTES
        for first in range(0, blocks, WORD * BLOCKS):
            count = min(WORD * BLOCKS, blocks - first)
            markers = _markers_of(self._data, self._start + first * BLOCK_BYTES, count)
            wrong = np.flatnonzero(markers != np.resize(_MARKERS, count))
            if wrong.size:
                break
        n = first + int(wrong[0])
        frame, block = divmod(n, BLOCKS)
        ahead = _markers_of(self._data, self._start + n * BLOCK_BYTES, min(2, blocks - n))
        known = np.flatnonzero(ahead[0] == _MARKERS)
        what = "a damaged marker"
        if known.size:
            lost = (int(known[0]) - block) % BLOCKS
            goes_on = len(ahead) < 2 or ahead[1] == _MARKERS[(known[0] + 1) % BLOCKS]
            if goes_on:
                what = f"blocks lost: {lost}" if lost <= BLOCKS // 2 else "out of order"
        keep = self._start + frame * FRAME_BYTES
        name = shlex.quote(str(self._path))
        raise InputError(
            f"{self._path}",
            f"{_named(_MARKERS[block])} at byte {self._start + n * BLOCK_BYTES} in frame {frame}",
            f"{_named(ahead[0])}, {what}",
            f"keep what comes before frame {frame}: head -c {keep} {name} > OUT.raw"
            if frame
            else "take another capture",
        )

    def _refuse_lead(self, byte: int) -> None:
        raise InputError(
            f"{self._path}",
            "whole up to its first whole frame",
            f"one with lost or damaged blocks at byte {byte}",
            f"leave them out: tail -c +{self._start + 1} {shlex.quote(str(self._path))} > OUT.raw",
        )

    def read_words(self, first: int, stop: int) -> Words:
        """See `SpikeStream`. Raises InputError if blocks are lost or damaged."""
        stop = min(stop, words_for(self.cycles))
        words = np.empty((max(stop - first, 0), *self.shape), np.uint32)
        for n in range(len(words)):
            begin = (first + n) * WORD
            frames = min(WORD, self.cycles - begin)
            self._check(begin, begin + frames)
            byte = self._start + begin * FRAME_BYTES
            blocks = self._data[byte : byte + frames * FRAME_BYTES].reshape(frames, BLOCKS, -1)
            halves = np.empty_like(blocks)
            halves[:, _PLACE] = blocks
            bits = np.unpackbits(halves, axis=2, bitorder="little")[..., :HALF]
            words[n] = pack_planes(bits.reshape(frames, *self.shape))[0]
        return words


def _named(marker: np.uint16) -> str:
    return f"channel {int(marker) >> 14} line {int(marker) >> 4 & 0x3FF}"


def write_raw(stream: SpikeStream, path: Path) -> None:
    """Writes a 1000 x 1000 stream as `.raw` in whole frames. The format cannot hold clock and
    start. Raises InputError for another size."""
    height, width = stream.shape
    if (width, height) != RAW_SIZE:
        raise InputError(
            "the size of a .raw stream", "1000x1000", f"{width}x{height}", "use .npz or .zarr"
        )
    marker = np.stack([_MARKERS & 0xFF, _MARKERS >> 8], axis=1).astype(np.uint8)
    with atomic_write(path) as part, part.open("wb") as file:
        for w in range(words_for(stream.cycles)):
            n = min(WORD, stream.cycles - w * WORD)
            bits = np.zeros((n, BLOCKS, BLOCK_BYTES * 8), np.uint8)
            planes = unpack_planes(stream.read_words(w, w + 1), 0, n)
            bits[..., :HALF] = planes.reshape(n, BLOCKS, HALF)
            blocks = np.packbits(bits, axis=2, bitorder="little")[:, _PLACE]
            blocks[..., -2:] |= marker
            file.write(blocks.tobytes())
