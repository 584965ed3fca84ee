"""Both ends of a stream of packets (`StreamOutbox`, `StreamInbox`), and the frames between them.

The packets form one endless byte stream, in which each stands behind its length (4 bytes). A frame
carries the next piece of the byte stream, and says where in it the first packet begins, so that a
receiver that lacks the frame before, or joins late, finds the next packet. Frames are made when the
panel needs them.

| bytes | content |
|---|---|
| 2 | magic "Vs" |
| 1 | version |
| 1 | 0 |
| 4 | number of the frame, from 0 |
| 2 | length T of the piece in the frame, bytes |
| 2 | place of the first packet that begins in the frame, 65535 for none |
| T | piece of the byte stream, then zeros to the end of the frame |
| 4 | CRC-32C of all preceding bytes |

Numbers are little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from link.coding.blocks import Blocks
from link.coding.crc import crc32c
from link.coding.reader import BlockReader, Bytes
from link.coding.writer import BlockWriter, blocks_of
from link.layout import PERIOD, Layout

LONGEST_PACKET: Final = 1 << 24
"""Longest packet, bytes."""
_HEAD: Final = struct.Struct("<2sBBIHH")
_CRC: Final = struct.Struct("<I")
_LENGTH: Final = struct.Struct("<I")
_MAGIC, _VERSION = b"Vs", 1
_NONE: Final = 0xFFFF
_KEPT: Final = 8
"""Number of blocks whose bytes are stored: a run that resumes shows the last ones again."""
State = dict[str, npt.NDArray[Any]]
"""Arrays of a checkpoint, by name."""


@dataclass(frozen=True)
class StreamFrame:
    """A frame of the table above.

    Attributes:
        number: number of the frame, modulo 2^32.
        piece: piece of the byte stream.
        begin: place in `piece` of the first packet that begins in it, None for none.
    """

    number: int
    piece: bytes
    begin: int | None


def room_in(size: int) -> int:
    """Bytes of the byte stream that a frame of `size` bytes has room for."""
    return min(size - _HEAD.size - _CRC.size, _NONE - 1)


def write_stream_frame(frame: StreamFrame, size: int) -> npt.NDArray[np.uint8]:
    """A frame as `size` bytes."""
    begin = _NONE if frame.begin is None else frame.begin
    head = _HEAD.pack(_MAGIC, _VERSION, 0, frame.number & 0xFFFFFFFF, len(frame.piece), begin)
    body = (head + frame.piece).ljust(size - _CRC.size, b"\0")
    return np.frombuffer(body + _CRC.pack(crc32c(body)), np.uint8)


def read_stream_frame(data: npt.NDArray[np.uint8]) -> StreamFrame | None:
    """Frame in `data`; None unless every part is correct."""
    raw = data.tobytes()
    body, end = raw[: -_CRC.size], raw[-_CRC.size :]
    if len(body) < _HEAD.size or not body.startswith(_MAGIC) or _CRC.pack(crc32c(body)) != end:
        return None
    _, version, zero, number, used, begin = _HEAD.unpack_from(body)
    if version != _VERSION or zero or used > len(body) - _HEAD.size:
        return None
    if begin != _NONE and begin >= used:
        return None
    piece = body[_HEAD.size : _HEAD.size + used]
    return StreamFrame(number, piece, None if begin == _NONE else begin)


class PacketParser:
    """Takes packets out of the pieces of a byte stream, in order.

    Attributes:
        lost: frames that did not arrive between two that did.
    """

    def __init__(self) -> None:
        self._held = b""
        self._next: int | None = None
        self._synchronised = False
        self.lost = 0

    def put(self, frame: StreamFrame) -> list[bytes]:
        """Takes the next frame that arrived. Returns the packets that it completes. A frame whose
        number is not above that of the last one is ignored."""
        if self._next is not None and frame.number < self._next:
            return []
        missing = 0 if self._next is None else frame.number - self._next
        self.lost += missing
        self._synchronised = self._synchronised and not missing
        self._next = frame.number + 1
        if self._synchronised:
            self._held += frame.piece
        elif frame.begin is not None:
            self._held, self._synchronised = frame.piece[frame.begin :], True
        else:
            self._held = b""
        return self._packets()

    def _packets(self) -> list[bytes]:
        packets: list[bytes] = []
        at = 0
        while len(self._held) - at >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._held, at)
            if length > LONGEST_PACKET:  # not a stream of ours, or CRC-32C has failed
                self._held, self._synchronised = b"", False
                return packets
            if len(self._held) - at - _LENGTH.size < length:
                break
            at += _LENGTH.size + length
            packets.append(self._held[at - length : at])
        self._held = self._held[at:]
        return packets


def with_length(packet: bytes) -> bytes:
    """A packet behind its length, as in the byte stream. Raises ValueError if it is too long."""
    if len(packet) > LONGEST_PACKET:
        raise ValueError(f"a packet must have at most {LONGEST_PACKET} bytes, not {len(packet)}")
    return _LENGTH.pack(len(packet)) + packet


def stream_blocks(layout: Layout, interleave: bool = True) -> Blocks:
    """Blocks of a stream. Their keystream has the period of the pilots."""
    return blocks_of(layout, interleave, PERIOD // layout.group)


def stream_rate(form: Blocks) -> int:
    """Bytes of packets, with their lengths, that a block carries."""
    return form.frames * room_in(form.frame_bytes)


class StreamOutbox(BlockWriter):
    """Packets in frames; see `BlockWriter`. Blocks are made in order, each when it is first shown.
    A block for which no packet is ready carries empty frames.

    Args:
        form: form of `stream_blocks`.
        blocks: number of blocks.
        ready: returns the next packet that is ready for a block, None if there is none.
    """

    def __init__(self, form: Blocks, blocks: int, ready: Callable[[int], bytes | None]) -> None:
        super().__init__(form, blocks)
        self._ready = ready
        self._rest = b""
        self._next = 0
        self._rows: dict[int, tuple[bytes, int]] = {}

    def _frames(self, block: int) -> Sequence[Bytes]:
        form = self._blocks
        if block >= self._next:
            if block != self._next:
                raise ValueError(f"block must be {self._next}, not {block}: a stream has an order")
            self._rows[block] = self._fill(block)
            self._rows.pop(block - _KEPT, None)
            self._next += 1
        row, begin = self._rows[block]
        room, number = room_in(form.frame_bytes), block * form.frames
        frames = []
        for n in range(form.frames):
            piece = row[n * room : (n + 1) * room]
            start = self._begins(row, begin, n * room, n * room + len(piece))
            frames.append(
                write_stream_frame(StreamFrame(number + n, piece, start), form.frame_bytes)
            )
        return frames

    def _fill(self, block: int) -> tuple[bytes, int]:
        """Bytes of a block, and the place of the first packet that begins in them."""
        size = stream_rate(self._blocks)
        parts, held = [self._rest], len(self._rest)
        begin = held
        while held < size:
            packet = self._ready(block)
            if packet is None:
                break
            parts.append(with_length(packet))
            held += len(parts[-1])
        row = b"".join(parts)
        self._rest = row[size:]
        return row[:size], begin

    @staticmethod
    def _begins(row: bytes, begin: int, low: int, high: int) -> int | None:
        """Place within row[low:high] of the first packet that begins there."""
        while begin < low:
            if begin + 4 > len(row):
                return None
            begin += 4 + int.from_bytes(row[begin : begin + 4], "little")
        return begin - low if begin < high else None

    @property
    def waiting(self) -> int:
        """Bytes of the packet that the last block has begun and not ended."""
        return len(self._rest)

    def state(self) -> State:
        """What the next blocks depend on, as arrays."""
        state = {
            "next": np.array([self._next]),
            "rest": np.frombuffer(self._rest, np.uint8),
        }
        for block, (row, begin) in self._rows.items():
            state[f"row/{block}"] = np.frombuffer(row, np.uint8)
            state[f"begin/{block}"] = np.array([begin])
        return state

    def restore(self, state: State) -> None:
        """Continues from a `state`."""
        self._next, self._rest = int(state["next"][0]), state["rest"].tobytes()
        self._rows = {
            int(name.removeprefix("row/")): (
                row.tobytes(), int(state[name.replace("row", "begin")][0])
            )
            for name, row in state.items() if name.startswith("row/")
        }  # fmt: skip
        self._cache.clear()


class Arrival(NamedTuple):
    """A packet that arrived.

    Attributes:
        group: group of the transmission that completed it.
        packet: its bytes.
    """

    group: int
    packet: bytes


class StreamInbox(BlockReader):
    """Decodes groups to packets; see `BlockReader`.

    Attributes:
        arrivals: packets in the order of their arrival; the user removes them.
    """

    def __init__(
        self, layout: Layout, *, interleave: bool = True, device: Device | None = None
    ) -> None:
        super().__init__(stream_blocks(layout, interleave), device)
        self._parser = PacketParser()
        self.arrivals: list[Arrival] = []

    @property
    def frames_lost(self) -> int:
        """Frames that did not arrive between two that did."""
        return self._parser.lost

    def _take(self, block: int, frames: Sequence[Bytes | None]) -> list[bool]:
        right = []
        last = (block + 1) * self._blocks.groups - 1
        for data in frames:
            frame = None if data is None else read_stream_frame(data)
            right.append(frame is not None)
            if frame is not None:
                self.arrivals += [Arrival(last, packet) for packet in self._parser.put(frame)]
        return right
