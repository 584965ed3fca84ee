"""A packet: one layer of one tile during a group of cycles. Numbers are little-endian.

    code (1 byte: its place in the catalogue), layer (1), cycles and 1024 times the cycles from the
    last multiple of 32 to the first one (2), tile (4), first cycle / 32 (4), CRC-32C of these
    twelve bytes and the data (4), data

The length of the data is not in a packet: the link or file that carries it states it. A packet that
is lost takes its layer, and the finer ones, of its tile in its cycles, and nothing else.

`Tiles` cuts a sensor into square tiles, in raster order; those at the border may be smaller.
`StreamCode` is what every stream code does: a tile's words to the bytes of its layers, and back.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import fastcrc
import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Words
from sensor.codec.columns import Damaged

MOST_CYCLES = 512
"""Cycles of a packet, at most."""
_HEAD = struct.Struct("<BBHII")
_CRC = struct.Struct("<I")
_APART = 1024
"""Factor of the cycles of a first cycle beyond whole words, in the field of the cycles."""
HEADER = _HEAD.size + _CRC.size
"""Bytes before the data."""
LENGTH = 4
"""Bytes of the length of a packet, in files and in the frames of a link."""


@dataclass(frozen=True)
class Tiles:
    """The tiles of a sensor.

    Attributes:
        shape: (height, width) of the sensor in pixels.
        side: side of a tile, pixels.
    """

    shape: tuple[int, int]
    side: int

    def __post_init__(self) -> None:
        if min(self.shape) < 1:
            raise ValueError(f"a sensor must have pixels, not {self.shape}")
        if not 8 <= self.side <= 128 or self.side % 8:
            raise ValueError(f"tile must be a multiple of 8 from 8 to 128, not {self.side}")

    @property
    def grid(self) -> tuple[int, int]:
        """(rows, columns) of tiles."""
        return -(-self.shape[0] // self.side), -(-self.shape[1] // self.side)

    def __len__(self) -> int:
        rows, columns = self.grid
        return rows * columns

    def place(self, tile: int) -> tuple[slice, slice]:
        """Rows and columns of the pixels of a tile."""
        y, x = divmod(tile, self.grid[1])
        side, (height, width) = self.side, self.shape
        return (
            slice(y * side, min((y + 1) * side, height)),
            slice(x * side, min((x + 1) * side, width)),
        )

    def offsets(self, cycles: int, phases: int) -> npt.NDArray[np.int64]:
        """First cycle of the second packet of each tile, of those of `cycles` cycles, (tiles,). The
        tiles of each of so many phases lie all over the sensor, so each brings about as many
        bits."""
        row, column = np.divmod(np.arange(len(self)), self.grid[1])
        offsets: npt.NDArray[np.int64] = (3 * row + column) % phases * (cycles // phases)
        return offsets

    def size(self, tile: int) -> tuple[int, int]:
        """(height, width) of a tile in pixels."""
        rows, columns = self.place(tile)
        return rows.stop - rows.start, columns.stop - columns.start


@dataclass(frozen=True)
class Layer:
    """One layer of a tile.

    Attributes:
        data: its bytes.
        spikes: number of spikes whose time is known from this layer on; a spike is in one layer
            alone.
        gain: the squared error of counts in a window of 41 cycles that it takes away, summed over
            pixels and cycles, estimated.
    """

    data: bytes
    spikes: int
    gain: float


class TileCode(Protocol):
    """A code of one tile during the cycles of one packet, which depends on nothing else."""

    @property
    def layers(self) -> int:
        """Layers that it sends; those after the first may be missing."""
        ...

    def encode(self, words: Words, cycles: int) -> list[Layer]:
        """The layers of (n, h, w) words, whose bits beyond `cycles` are 0."""
        ...

    def decode(self, layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> Words:
        """(n, h, w) words of the first one or more layers. Raises Damaged for other bytes."""
        ...


@dataclass(frozen=True)
class Packet:
    """One layer of a tile.

    Attributes:
        code: number of the code in the catalogue.
        layer: 0 for the coarsest.
        tile: number in raster order.
        first: first cycle.
        cycles: 1 to 512.
        data: what the code made.
        spikes: number of spikes whose time is known from this layer on; 0 in a received one.
        gain: error that it takes away, see `Layer`; 0 in a received one.
    """

    code: int
    layer: int
    tile: int
    first: int
    cycles: int
    data: bytes
    spikes: int = 0
    gain: float = 0.0

    @property
    def size(self) -> int:
        """Bytes on the wire, with the length that a row of packets has before each."""
        return LENGTH + HEADER + len(self.data)

    def to_bytes(self) -> bytes:
        """The packet as it is sent. Raises ValueError for numbers beyond its fields."""
        word, beyond = divmod(self.first, WORD)
        try:
            head = _HEAD.pack(self.code, self.layer, self.cycles + _APART * beyond, self.tile, word)
        except struct.error as exc:
            raise ValueError(f"a packet must start below cycle 2^37: {exc}") from exc
        crc = fastcrc.crc32.iscsi(self.data, fastcrc.crc32.iscsi(head))
        return head + _CRC.pack(crc) + self.data

    @classmethod
    def of(cls, data: bytes) -> Packet:
        """The packet of these bytes. Raises Damaged for any that `to_bytes` did not make."""
        if len(data) < HEADER:
            raise Damaged("a packet that is cut off")
        head, rest = data[: _HEAD.size], data[HEADER:]
        (crc,) = _CRC.unpack(data[_HEAD.size : HEADER])
        if crc != fastcrc.crc32.iscsi(rest, fastcrc.crc32.iscsi(head)):
            raise Damaged("a packet with another checksum")
        code, layer, cycles, tile, word = _HEAD.unpack(head)
        beyond, cycles = divmod(cycles, _APART)
        if beyond >= WORD:
            raise Damaged(f"a packet {beyond} cycles beyond a word")
        if not 1 <= cycles <= MOST_CYCLES:
            raise Damaged(f"a packet of {cycles} cycles")
        return cls(code, layer, tile, word * WORD + beyond, cycles, rest)
