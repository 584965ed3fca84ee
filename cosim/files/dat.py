"""`.dat`, the format of public spike recordings: no header, frames one after another.

A frame is row-major from the bottom row up, one bit a pixel, the least significant bit of a byte
first; 12 500 bytes at 400 x 250. In numpy:
packbits(spikes[:, ::-1].reshape(T, -1), axis=1, bitorder="little"). Some writers pad a frame to
whole bytes and some readers assume none: sizes where that matters are refused.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.whole import whole
from cosim.viform import WORD, SpikeStream, Words, pack_planes, unpack_planes, words_for

__all__ = ["DAT_CLOCK", "DAT_SIZE", "DatStream", "check_dat_size", "write_dat"]

DAT_SIZE = (400, 250)
"""Width and height of a `.dat` when none is given: every public recording of the format."""
DAT_CLOCK = Clock(40_000)
"""The file says no clock; recordings are made at 40 kHz."""


def check_dat_size(width: int, height: int) -> int:
    """Bytes in a frame; InputError where it is ambiguous."""
    if width < 1 or height < 1 or width * height % 8:
        raise InputError(
            "the size of a .dat frame",
            "WIDTHxHEIGHT with a product that is a multiple of 8",
            f"{width}x{height}",
            "use .npz or .zarr for other sizes",
        )
    return width * height // 8


class DatStream:
    """A `.dat` file as a spike stream; frames are read as they are asked for."""

    def __init__(self, path: Path, size: tuple[int, int] | None = None) -> None:
        width, height = size or DAT_SIZE
        frame = check_dat_size(width, height)
        length = path.stat().st_size
        if length == 0 or length % frame:
            frames = f", which is {length // frame} frames and {length % frame} bytes over"
            raise InputError(
                f"{path}",
                f"whole frames of {frame} bytes ({width}x{height})",
                f"{length} bytes{frames if length else ''}",
                "give its true --size WxH, or take a file that is not cut off",
            )
        self._frames = np.memmap(path, np.uint8, "r").reshape(-1, frame)
        self._shape = (height, width)

    @property
    def shape(self) -> tuple[int, int]:
        return self._shape

    @property
    def cycles(self) -> int:
        return len(self._frames)

    @property
    def clock(self) -> Clock:
        return DAT_CLOCK

    def read_words(self, first: int, stop: int) -> Words:
        frames = self._frames[first * WORD : stop * WORD]
        bits = np.unpackbits(frames, axis=1, bitorder="little")
        return pack_planes(bits.reshape(-1, *self._shape)[:, ::-1])


def write_dat(stream: SpikeStream, path: Path) -> None:
    """Writes a stream as `.dat`. Clock and start are not kept: the format has no place for them."""
    height, width = stream.shape
    check_dat_size(width, height)
    with whole(path) as part, part.open("wb") as file:
        for w in range(words_for(stream.cycles)):
            n = min(WORD, stream.cycles - w * WORD)
            planes = unpack_planes(stream.read_words(w, w + 1), 0, n)[:, ::-1]
            file.write(np.packbits(planes.reshape(n, -1), axis=1, bitorder="little").tobytes())
