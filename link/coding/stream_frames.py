"""Frames of a stream of packets: numbered pieces of an endless row of bytes.

Each packet stands in the row behind its length (4 bytes). A frame carries the next piece of the
row, and says where in it the first packet begins, so that a receiver that lacks the frame before,
or joins late, finds the next packet.

| bytes | content |
|---|---|
| 2 | magic "Vs" |
| 1 | version |
| 1 | 0 |
| 4 | number of the frame, from 0 |
| 2 | bytes of the row in the frame |
| 2 | place of the first packet that begins in the frame, 65535 for none |
| T | piece of the row, then zeros |
| 4 | CRC-32C of all preceding bytes |

Numbers are little-endian.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.coding.crc import crc32c

LONGEST_PACKET: Final = 1 << 24
"""Longest packet, bytes."""
_HEAD: Final = struct.Struct("<2sBBIHH")
_CRC: Final = struct.Struct("<I")
_LENGTH: Final = struct.Struct("<I")
_MAGIC, _VERSION = b"Vs", 1
_NONE: Final = 0xFFFF


@dataclass(frozen=True)
class StreamFrame:
    """A frame.

    Attributes:
        number: number of the frame.
        piece: bytes of the row.
        begin: place in `piece` of the first packet that begins in it, None for none.
    """

    number: int
    piece: bytes
    begin: int | None


def room_in(size: int) -> int:
    """Bytes of the row that a frame of `size` bytes has room for."""
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


class PacketRow:
    """Takes packets out of the pieces of a row, in order.

    Attributes:
        lost: frames that did not arrive between two that did.
    """

    def __init__(self) -> None:
        self._held = b""
        self._next: int | None = None
        self._in_step = False
        self.lost = 0

    def put(self, frame: StreamFrame) -> list[bytes]:
        """Takes the next frame that arrived. Returns the packets that it completes. A frame whose
        number is not above that of the last one is ignored."""
        if self._next is not None and frame.number < self._next:
            return []
        missing = 0 if self._next is None else frame.number - self._next
        self.lost += missing
        self._in_step = self._in_step and not missing
        self._next = frame.number + 1
        if self._in_step:
            self._held += frame.piece
        elif frame.begin is not None:
            self._held, self._in_step = frame.piece[frame.begin :], True
        else:
            self._held = b""
        return self._packets()

    def _packets(self) -> list[bytes]:
        packets: list[bytes] = []
        at = 0
        while len(self._held) - at >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._held, at)
            if length > LONGEST_PACKET:  # not a row of ours, or CRC-32C has failed
                self._held, self._in_step = b"", False
                return packets
            if len(self._held) - at - _LENGTH.size < length:
                break
            at += _LENGTH.size + length
            packets.append(self._held[at - length : at])
        self._held = self._held[at:]
        return packets


def in_row(packet: bytes) -> bytes:
    """A packet as it stands in the row. Raises ValueError for one that is too long."""
    if len(packet) > LONGEST_PACKET:
        raise ValueError(f"a packet must have at most {LONGEST_PACKET} bytes, not {len(packet)}")
    return _LENGTH.pack(len(packet)) + packet
