"""Frames: one packet of the fountain each, with its session and a CRC.

| bytes | content |
|---|---|
| 2 | magic "Vf" |
| 1 | version |
| 4 | session: CRC-32C of the file's length, name and CRC |
| 4 | length of the fountain's data |
| 4 | number of the packet: source block, symbol (RFC 6330, section 3.2) |
| T | the packet's symbol |
| | zeros, up to whole codewords |
| 4 | CRC-32C of all preceding bytes |

Numbers are little-endian, except the packet's.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.coding.crc import crc32c
from link.coding.fountain import Packet, codable, source_blocks

_HEAD: Final = struct.Struct("<2sBII")
_CRC: Final = struct.Struct("<I")
_MAGIC, _VERSION = b"Vf", 1
_NUMBER: Final = 4


@dataclass(frozen=True)
class Frame:
    """A frame.

    Attributes:
        session: number of the transmission.
        length: bytes of the fountain's data.
        packet: number and symbol.
    """

    session: int
    length: int
    packet: Packet


def write_frame(frame: Frame, size: int) -> npt.NDArray[np.uint8]:
    """A frame as `size` bytes."""
    body = _HEAD.pack(_MAGIC, _VERSION, frame.session, frame.length) + frame.packet
    body = body.ljust(size - _CRC.size, b"\0")
    return np.frombuffer(body + _CRC.pack(crc32c(body)), np.uint8)


def read_frame(data: npt.NDArray[np.uint8], symbol: int) -> Frame | None:
    """Frame in `data`, with a symbol of `symbol` bytes; None unless every part is correct."""
    raw = data.tobytes()
    body, end = raw[: -_CRC.size], raw[-_CRC.size :]
    if not body.startswith(_MAGIC) or _CRC.pack(crc32c(body)) != end:
        return None
    _, version, session, length = _HEAD.unpack_from(body)
    packet = body[_HEAD.size : _HEAD.size + _NUMBER + symbol]
    if version != _VERSION or not codable(length, symbol):
        return None
    if len(packet) != _NUMBER + symbol or packet[0] >= source_blocks(length, symbol):
        return None
    return Frame(session, length, packet)
