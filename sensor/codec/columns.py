"""Columns of whole numbers as bytes: Exp-Golomb codes, or zstd over LEB128 where that is smaller.

A column is: tag (1 byte: order of the Exp-Golomb code, or 255 for zstd), values (4 bytes), bytes
that follow (4), all little-endian. An empty column is nine zero bytes.
"""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt
from numcodecs.zstd import Zstd

from sensor.codec.bits import golomb_size, leb_size, read_golomb, read_leb, write_golomb, write_leb

Column = npt.NDArray[np.uint32]
_HEAD = struct.Struct("<BII")
_ZSTD = 255
_ORDERS = 16
_SAMPLE = 4096
"""Number of values that the choice of the Exp-Golomb order is based on."""


class Damaged(ValueError):
    """The bytes are not the output of this encoder."""


def pack_column(values: Column, level: int | None) -> bytes:
    """The bytes of a column. level: zstd level; None uses Exp-Golomb codes only."""
    if not len(values):
        return bytes(_HEAD.size)
    stride = max(len(values) // _SAMPLE, 1)
    order = min(range(_ORDERS), key=lambda k: golomb_size(values, k, stride))
    size = golomb_size(values, order, 1) // 8 + 1
    if level is not None:
        octets = np.empty(leb_size(values), np.uint8)
        write_leb(values, octets)
        squeezed = bytes(Zstd(level=level).encode(octets))
        if len(squeezed) < size:
            return _HEAD.pack(_ZSTD, len(values), len(squeezed)) + squeezed
    room = np.empty(size, np.uint8)
    data = room[: write_golomb(values, order, room)].tobytes()
    return _HEAD.pack(order, len(values), len(data)) + data


def _content_size(head: bytes) -> int | None:
    """Content size in the header of a zstd frame; None if absent (RFC 8878, 3.1.1)."""
    if len(head) < 6 or head[:4] != b"\x28\xb5\x2f\xfd":
        return None
    single = head[4] >> 5 & 1
    at = 5 + (1 - single) + (0, 1, 2, 4)[head[4] & 3]
    length = (single, 2, 4, 8)[head[4] >> 6]
    field = head[at : at + length]
    if not length or len(field) < length:
        return None
    return int.from_bytes(field, "little") + (256 if length == 2 else 0)


def values_in(data: memoryview, most: int) -> int:
    """Total number of values in the columns of `data`, read from their headers.

    Counting stops at a header that `unpack_column` refuses. most: as in `unpack_column`.
    """
    total = 0
    while len(data) >= _HEAD.size:
        _, count, length = _HEAD.unpack(data[: _HEAD.size])
        if count > most:
            break
        total, data = total + count, data[_HEAD.size + length :]
    return total


def unpack_column(data: memoryview, most: int) -> tuple[Column, memoryview]:
    """The first column in `data`, and the bytes after it.

    most: largest number of values that the column may hold. Raises Damaged for a header or values
    that `pack_column` cannot have written.
    """
    if len(data) < _HEAD.size:
        raise Damaged("a column is cut off")
    tag, count, length = _HEAD.unpack(data[: _HEAD.size])
    body, rest = data[_HEAD.size : _HEAD.size + length], data[_HEAD.size + length :]
    if len(body) < length or count > most or (tag >= _ORDERS and tag != _ZSTD):
        raise Damaged("a column's head")
    values = np.zeros(count, np.uint32)
    if not count:
        if length or tag:
            raise Damaged("an empty column with bytes")
        return values, rest
    if tag != _ZSTD:
        if count > 8 * length or not read_golomb(np.frombuffer(body, np.uint8), tag, values):
            raise Damaged("a column's bits")
        return values, rest
    size = _content_size(bytes(body[:18]))
    if size is None or not count <= size <= 5 * count:  # before zstd takes memory for it
        raise Damaged("a column's zstd")
    try:
        octets = np.frombuffer(Zstd().decode(bytes(body)), np.uint8)
    except MemoryError:
        raise
    except Exception as exc:  # what zstd raises is not documented
        raise Damaged("a column's zstd") from exc
    if not read_leb(octets, values):
        raise Damaged("a column's bytes")
    return values, rest
