"""`.vfl`: a stream as packets. All numbers are little-endian.

head     80 bytes: "VIFVFL1\\n"; code (1 byte: its place in the catalogue), layers (1), cycles in a
         packet (2), side of a tile (2), refine (1), 1 byte that is 0, height (4), width (4), cycles
         (8), start (8, signed), clock (8 and 8: numerator and denominator in Hz), k, threshold,
         threshold noise (8 each, IEEE 754, 0 where they are not used); CRC-32C of it (4)
packets  for each group of cycles: what the source says beyond its spikes (packets/ancillary.py),
         then for each layer, for each tile, its packet (packet.py); each after its bytes (4)

Nothing is carried from one group to the next, so that any part is read without the rest, and a
stream of any length is written and read in the memory of a group.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import fastcrc
import numpy as np

from cosim import Clock, InputError, SpikeStream
from cosim.compute.memory import check_memory
from cosim.files.atomic import atomic_write
from cosim.spikes.ancillary import Ancillary
from cosim.spikes.viform import WORD, Words, words_for
from sensor.codec.columns import Damaged
from sensor.codec.packets.ancillary import CODES, AncillaryDecoder, AncillaryEncoder
from sensor.codec.packets.catalogue import KINDS, StreamCode
from sensor.codec.packets.coder import StreamEncoder
from sensor.codec.packets.decoder import StreamDecoder
from sensor.codec.packets.packet import HEADER, Packet, Tiles

VFL = ".vfl"
"""Ending of the files."""
_MAGIC = b"VIFVFL1\n"
_HEAD = struct.Struct("<8sBBHHBxIIQqQQddd")
_NUMBER = struct.Struct("<I")
_MOST = 128 * 128 * 512
"""Bytes of a packet, at most; raw takes an eighth of it."""


def write_vfl(stream: SpikeStream, path: Path, code: StreamCode) -> int:
    """Writes a stream; the bytes written. Raises InputError where the file cannot be written or
    holds no such stream."""
    start = int(getattr(stream, "start", 0))
    try:
        head = _HEAD.pack(
            _MAGIC, code.number, code.layers, code.cycles, code.tile, code.refine, *stream.shape,
            stream.cycles, start, stream.clock.num, stream.clock.den, code.k, code.threshold,
            code.threshold_noise,
        )  # fmt: skip
    except struct.error as exc:
        raise InputError(
            f"{path}", "of a size and clock below 2^32 and 2^64", str(exc), "write a .zarr instead"
        ) from exc
    encoder, step = StreamEncoder(code, stream.shape), code.cycles // WORD
    said = AncillaryEncoder(Tiles(stream.shape, code.tile))
    said.take(replace(e, cycle=e.cycle - start) for e in getattr(stream, "ancillary", ()))
    with atomic_write(path) as part, part.open("wb") as file:
        file.write(head + _NUMBER.pack(fastcrc.crc32.iscsi(head)))
        for first in range(0, words_for(stream.cycles), step):
            words = stream.read_words(first, min(first + step, words_for(stream.cycles)))
            cycles = min(WORD * len(words), stream.cycles - WORD * first)
            for packet in said.group(WORD * first, cycles):
                _write(file, packet)
            for packet in encoder.encode(words, WORD * first, cycles):
                _write(file, packet)
        for packet in encoder.flush():
            _write(file, packet)
        return file.tell()


def _write(file: BinaryIO, packet: Packet) -> None:
    data = packet.to_bytes()
    file.write(_NUMBER.pack(len(data)) + data)


class VflStream:
    """A file as a stream. Opening reads it once, to check it; the last group read is kept.

    Attributes:
        shape, cycles, clock, start: shape, cycles, clock and start of the stream.
        code: code that the stream went through.
        ancillary: what its source says beyond the spikes, see `Viform`.

    Raises InputError for what is no such file, whole and undamaged, and where memory is short.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            with path.open("rb") as file:
                self._read_head(file)
                self._places = self._check(file)
        except OSError as exc:
            raise InputError(
                "the stream", "readable", f"{path} ({exc.strerror})", "check it"
            ) from exc
        except (ValueError, struct.error) as exc:
            raise self._bad(exc) from exc
        self._kept: tuple[int, Words] | None = None

    def _bad(self, exc: Exception) -> InputError:
        given = str(exc) if isinstance(exc, Damaged) else "something else"
        return InputError(f"{self._path}", "a whole packet file", given, "copy or convert it again")

    def _read_head(self, file: BinaryIO) -> None:
        """Raises ValueError (Damaged is one) and struct.error."""
        head = file.read(_HEAD.size)
        magic, kind, layers, group, tile, refine, height, width, cycles, start, num, den, *rest = (
            _HEAD.unpack(head)
        )
        if magic != _MAGIC:
            raise Damaged("another kind of file, or another version of it")
        (crc,) = _NUMBER.unpack(file.read(_NUMBER.size))
        if (
            crc != fastcrc.crc32.iscsi(head)
            or kind >= len(KINDS)
            or not all(map(math.isfinite, rest))
        ):
            raise Damaged("a head that was changed")
        if not (height and width and cycles):
            raise Damaged(f"a stream of {cycles} cycles of {width}x{height}")
        k, threshold, noise = rest
        self.code = StreamCode(list(KINDS)[kind], group, tile, layers, k, refine, threshold, noise)
        self.shape: tuple[int, int] = (height, width)
        self.cycles, self.start, self.clock = int(cycles), int(start), Clock(num, den)
        self._tiles = len(Tiles(self.shape, tile))

    def _check(self, file: BinaryIO) -> list[int]:
        """Where each group begins in the file. Every packet must be in its place and undamaged."""
        places, said = [], AncillaryDecoder(Tiles(self.shape, self.code.tile))
        found: list[Ancillary] = []
        for first in range(0, self.cycles, self.code.cycles):
            places.append(file.tell())
            for data in self._group(file, first):
                packet = Packet.of(data)
                if packet.code in CODES and not said.take(packet):
                    raise Damaged("ancillary data that cannot be")
            found += said.read(first, first + self.code.cycles)
        self.ancillary = tuple(replace(each, cycle=each.cycle + self.start) for each in found)
        if file.read(1):
            raise Damaged("a file with bytes after its last packet")
        return places

    def _group(self, file: BinaryIO, first: int) -> Iterator[bytes]:
        """Packets of the group at cycle `first`. Raises Damaged."""
        cycles = min(self.code.cycles, self.cycles - first)
        data = self._next(file)
        packet = Packet.of(data)
        while packet.code in CODES:
            if (packet.first, packet.cycles) != (first, cycles):
                raise Damaged("packets in another order")
            yield data
            data = self._next(file)
            packet = Packet.of(data)
        for layer in range(self.code.make().layers):
            for tile in range(self._tiles):
                if layer or tile:
                    data = self._next(file)
                    packet = Packet.of(data)
                place = (packet.code, packet.layer, packet.tile, packet.first, packet.cycles)
                if place != (self.code.number, layer, tile, first, cycles):
                    raise Damaged("packets in another order")
                yield data

    def _next(self, file: BinaryIO) -> bytes:
        """The next packet. Raises Damaged."""
        data = file.read(_NUMBER.size)
        if len(data) < _NUMBER.size:
            raise Damaged("a file that is cut off")
        (size,) = _NUMBER.unpack(data)
        if not HEADER <= size <= _MOST:
            raise Damaged(f"a packet of {size} bytes")
        data = file.read(size)
        if len(data) < size:
            raise Damaged("a file that is cut off")
        return data

    def read_words(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded); see `SpikeStream`."""
        step = self.code.cycles // WORD
        parts = []
        for group in range(first // step, -(-stop // step)):
            words = self._decoded(group)
            parts.append(words[max(first - group * step, 0) : stop - group * step])
        if not parts:
            return np.zeros((0, *self.shape), np.uint32)
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _decoded(self, number: int) -> Words:
        """Words of a group."""
        if self._kept is not None and self._kept[0] == number:
            return self._kept[1]
        pixels, first = self.shape[0] * self.shape[1], number * self.code.cycles
        cycles = min(self.code.cycles, self.cycles - first)
        # Twice the planes, and in each thread what the densest tile takes.
        need = pixels * (words_for(self.code.cycles) * 8 + 4) + (self.code.tile**2 * cycles << 4)
        check_memory(f"{self._path} in memory", need, "convert it in parts")
        decoder = StreamDecoder(self.code, self.shape, first)
        try:
            with self._path.open("rb") as file:
                file.seek(self._places[number])
                for data in self._group(file, first):
                    decoder.take(data)
            decoded = decoder.read(first + cycles)
            if decoded.held.any() or decoded.missing.any() or decoder.statistics["damaged"]:
                raise Damaged("packets whose data cannot be")
        except OSError as exc:
            raise InputError(
                "the stream", "readable", f"{self._path} ({exc.strerror})", "check it"
            ) from exc
        except ValueError as exc:
            raise self._bad(exc) from exc
        self._kept = number, decoded.words
        return decoded.words
