"""A packet: one layer of one tile during a group of cycles. Numbers are little-endian.

    code (1 byte: its place in the catalogue), layer (1), cycles (2), tile (4), first cycle / 32
    (4), CRC-32C of these twelve bytes and the data (4), data

Tiles are counted in raster order. The length of the data is the carrier's business. A packet that
is lost takes its layer, and the finer ones, of its tile in its cycles, and nothing else.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import fastcrc

from cosim.spikes.viform import WORD
from sensor.codec.columns import Damaged
from sensor.codec.packets.part import MOST_CYCLES

_HEAD = struct.Struct("<BBHII")
_CRC = struct.Struct("<I")
HEADER = _HEAD.size + _CRC.size
"""Bytes before the data."""
LENGTH = 4
"""Bytes of the length of a packet, in files and in the frames of a link."""


@dataclass(frozen=True)
class Packet:
    """One layer of a tile.

    Attributes:
        code: number of the code in the catalogue.
        layer: 0 for the coarsest.
        tile: number in raster order.
        first: first cycle, a multiple of 32.
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
        try:
            head = _HEAD.pack(self.code, self.layer, self.cycles, self.tile, self.first // WORD)
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
        if not 1 <= cycles <= MOST_CYCLES:
            raise Damaged(f"a packet of {cycles} cycles")
        return cls(code, layer, tile, word * WORD, cycles, rest)
