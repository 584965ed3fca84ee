"""Ancillary data of a stream as packets of their own, beside those of its spikes.

Their codes are not in the catalogue. A write to registers, code 128:

    cycle - first (2 bytes), packet of light (8, IEEE 754 binary64), rows (2 + 2)

The registers in force are sent again with each group, so a receiver that joins late, or has lost a
write, has them with the next group. A tile of a plane of charges, code 129:

    cycle - first (2 bytes), cycles of the span (4), levels of a threshold (2), a column of levels

A tile that is lost shows no charge. Numbers are little-endian.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from cosim.spikes.ancillary import Ancillary, ChargePlane, RegisterWrite
from sensor.codec.columns import Damaged, pack_column, unpack_column
from sensor.codec.packets.packet import Packet, Tiles

WRITE: Final = 128
CHARGES: Final = 129
CODES: Final = (WRITE, CHARGES)
_WRITE: Final = struct.Struct("<HdHH")
_CHARGES: Final = struct.Struct("<HIH")
_LEVEL: Final = 3
"""zstd level of a column of charges."""


class AncillaryEncoder:
    """Ancillary data to the packets of the groups in which they hold."""

    def __init__(self, tiles: Tiles) -> None:
        self._tiles = tiles
        self._waiting: list[Ancillary] = []
        self._now: RegisterWrite | None = None

    def take(self, several: Iterable[Ancillary]) -> None:
        """Takes what a block of the stream says."""
        self._waiting += several

    def group(self, first: int, cycles: int) -> list[Packet]:
        """Packets of the next group, cycles `first` to `first + cycles`; writes come first."""
        stop, packets = first + cycles, []
        due = [each for each in self._waiting if each.cycle < stop]
        self._waiting = [each for each in self._waiting if each.cycle >= stop]
        if self._now is not None and not any(each.cycle == first for each in _writes(due)):
            packets.append(self._write(self._now, first, cycles, 0))
        for each in due:
            if isinstance(each, RegisterWrite):
                packets.append(self._write(each, first, cycles, each.cycle - first))
                self._now = each
            else:
                packets += self._charges(each, first, cycles)
        return sorted(packets, key=lambda packet: packet.code)

    def _write(self, write: RegisterWrite, first: int, cycles: int, at: int) -> Packet:
        data = _WRITE.pack(at, write.packet, *write.rows)
        return Packet(WRITE, 0, at, first, cycles, data)

    def _charges(self, plane: ChargePlane, first: int, cycles: int) -> list[Packet]:
        head = _CHARGES.pack(plane.cycle - first, plane.span, plane.levels)
        packets = []
        for tile in range(len(self._tiles)):
            gain = plane.gain[self._tiles.place(tile)].astype(np.uint32).reshape(-1)
            data = head + pack_column(gain, _LEVEL)
            packets.append(Packet(CHARGES, 0, tile, first, cycles, data))
        return packets

    def state(self) -> tuple[Ancillary, ...]:
        """What waits for its group; the registers in force first, if any were written."""
        return (*([] if self._now is None else [self._now]), *self._waiting)

    def restore(self, several: Sequence[Ancillary], first: int) -> None:
        """Goes on from a state. first: first cycle of the next group."""
        before = [each for each in _writes(several) if each.cycle < first]
        self._now = before[-1] if before else None
        self._waiting = [each for each in several if each is not self._now]


class AncillaryDecoder:
    """Packets of ancillary data to what they say.

    Args:
        tiles: tiles of the stream.
    """

    def __init__(self, tiles: Tiles) -> None:
        self._tiles = tiles
        self._packets: dict[tuple[int, int, int, int], Packet] = {}
        self._now: RegisterWrite | None = None

    def take(self, packet: Packet) -> bool:
        """Takes a packet; whether it is one of this stream."""
        try:
            at = self._read(packet).cycle
        except Damaged:
            return False
        self._packets[packet.first, at, packet.code, packet.tile] = packet
        return True

    def _read(self, packet: Packet) -> RegisterWrite | ChargePlane:
        """What a packet says; a plane of charges has the tile alone. Raises Damaged."""
        height = self._tiles.shape[0]
        try:
            if packet.code == WRITE:
                at, light, top, stop = _WRITE.unpack(packet.data)
                fits = math.isfinite(light) and light > 0 and top < stop <= height
                said: RegisterWrite | ChargePlane = RegisterWrite(
                    packet.first + at, light, (top, stop)
                )
            else:
                at, span, levels = _CHARGES.unpack(packet.data[: _CHARGES.size])
                if packet.tile >= len(self._tiles):
                    raise Damaged("charges of a tile that is not there")
                size = self._tiles.size(packet.tile)
                column = memoryview(packet.data)[_CHARGES.size :]
                gain, rest = unpack_column(column, size[0] * size[1])
                fits = gain.size == size[0] * size[1] and not len(rest) and span > 0
                fits = fits and levels > 0 and int(gain.max()) <= levels
                said = ChargePlane(
                    packet.first + at, span,
                    gain.astype(np.uint16).reshape(size) if fits else np.zeros(size, np.uint16),
                    levels,
                )  # fmt: skip
        except struct.error as exc:
            raise Damaged("ancillary data of another size") from exc
        if not fits or at >= packet.cycles:
            raise Damaged("ancillary data that cannot be")
        return said

    def read(self, first: int, stop: int) -> tuple[Ancillary, ...]:
        """What holds from cycles `first` to `stop` on, in their order, without what is known."""
        due = sorted(key for key in self._packets if key[1] < stop)
        found: list[Ancillary] = []
        planes: dict[tuple[int, int, int], ChargePlane] = {}
        for key in due:
            packet = self._packets.pop(key)
            if key[1] < first:
                continue
            said = self._read(packet)
            if isinstance(said, RegisterWrite):
                known = self._now
                if known is None or (known.packet, known.rows) != (said.packet, said.rows):
                    found.append(said)
                    self._now = said
                continue
            place = said.cycle, said.span, said.levels
            if place not in planes:
                whole = np.zeros(self._tiles.shape, np.uint16)
                planes[place] = ChargePlane(said.cycle, said.span, whole, said.levels)
                found.append(planes[place])
            planes[place].gain[self._tiles.place(packet.tile)] = said.gain
        return tuple(found)

    @property
    def waiting(self) -> list[Packet]:
        """Packets that were not read yet."""
        return list(self._packets.values())

    @property
    def known(self) -> tuple[RegisterWrite, ...]:
        """The registers in force, if any were written."""
        return () if self._now is None else (self._now,)

    def restore(self, waiting: Iterable[Packet], known: Sequence[Ancillary]) -> None:
        """Goes on from a state."""
        self._packets = {}
        self._now = next(iter(_writes(known)), None)
        for packet in waiting:
            self.take(packet)


def _writes(several: Iterable[Ancillary]) -> list[RegisterWrite]:
    return [each for each in several if isinstance(each, RegisterWrite)]
