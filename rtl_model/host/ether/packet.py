"""Etherbone packets with addresses and data of 32 bits, as LiteEth uses them.

    bytes 0-1   magic 0x4e6f
    byte  2     version 1 in bits 7:4; bit 2 NR no reads, bit 1 PR probe reply, bit 0 PF probe
    byte  3     width of addresses in bits 7:4, of data in bits 3:0 (bit mask, 4: 32 bits)
    bytes 4-7   padding; in a probe an identification, which the reply repeats
    records     flags, byte enables, wcount, rcount
                if wcount: base_write_addr, then wcount words
                if rcount: base_ret_addr, then rcount addresses

All fields are big-endian. Reads follow the writes of their record. The answer is a packet that
writes the words read to base_ret_addr, so this field identifies the request. LiteEth takes one
record a packet, ignores the flags, and repeats what follows the head of a probe.

Sources: OHWR, "Etherbone Core specification", version 1.0 (T. Terpstra, M. Kreider, 2012);
LiteEth, liteeth/frontend/etherbone.py and liteeth/common.py.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Words = npt.NDArray[np.uint32]
"""Words or byte addresses, (n,) big-endian uint32."""

MOST_WORDS = 255
"""Most words that a record writes, and most that it reads."""
MOST_BYTES = 65_507
"""Longest payload of a UDP datagram over IPv4."""

_MAGIC, _VERSION, _WIDTHS = 0x4E6F, 1, 0x44
_PF, _PR, _NR = 1, 2, 4
_HEAD = 8
_ENABLES = 0x0F  # all bytes of a word
_PLAIN = struct.pack(">HBB4x", _MAGIC, _VERSION << 4, _WIDTHS)
_PROBE = struct.pack(">HBB", _MAGIC, _VERSION << 4 | _PF, _WIDTHS)
_REPLY = struct.pack(">HBB", _MAGIC, _VERSION << 4 | _PR, _WIDTHS)
_EMPTY = bytes(4)  # LiteEth needs at least one word after the head
_NONE = np.empty(0, ">u4")


class Malformed(ValueError):
    """Bytes that are no Etherbone packet; the text is one line."""


class Record(NamedTuple):
    """One record.

    Attributes:
        write_address: byte address of the first written word.
        written: words to write to consecutive addresses.
        return_address: base_ret_addr, which the answer repeats.
        reads: byte addresses to read.
    """

    write_address: int = 0
    written: Words = _NONE
    return_address: int = 0
    reads: Words = _NONE


class Packet(NamedTuple):
    """A parsed packet.

    Attributes:
        probe, reply: flags PF and PR.
        records: records of the packet.
        rest: bytes after the first four, which the reply to a probe repeats.
    """

    probe: bool
    reply: bool
    records: list[Record]
    rest: bytes


def parse(data: bytes) -> Packet:
    """Parses a packet. Raises Malformed."""
    if len(data) < _HEAD:
        raise Malformed(f"a packet of {len(data)} bytes, shorter than its head of {_HEAD}")
    magic, flags, widths = struct.unpack_from(">HBB", data)
    if magic != _MAGIC:
        raise Malformed(f"magic {magic:#06x}, not {_MAGIC:#06x}")
    if flags >> 4 != _VERSION:
        raise Malformed(f"version {flags >> 4} of Etherbone, not {_VERSION}")
    probe, reply = bool(flags & _PF), bool(flags & _PR)
    if probe or reply:
        return Packet(probe, reply, [], data[4:])
    if widths != _WIDTHS:
        raise Malformed(f"widths {widths:#04x} of address and data, not {_WIDTHS:#04x} (32 bits)")
    records = []
    at = _HEAD
    while at < len(data):
        record, at = _record(data, at)
        records.append(record)
    return Packet(False, False, records, data[4:])


def _record(data: bytes, at: int) -> tuple[Record, int]:
    """The record at an offset, and the offset after it."""
    if len(data) - at < 4:
        raise Malformed(f"{len(data) - at} bytes after the last record")
    writes, reads = data[at + 2], data[at + 3]
    at += 4
    end = at + 4 * (writes + (writes > 0) + reads + (reads > 0))
    if end > len(data):
        raise Malformed(
            f"a record of {writes} writes and {reads} reads in a packet of {len(data)} bytes"
        )
    write_address, written, return_address, addresses = 0, _NONE, 0, _NONE
    if writes:
        write_address = int.from_bytes(data[at : at + 4], "big")
        written = np.frombuffer(data, ">u4", writes, at + 4)
        at += 4 + 4 * writes
    if reads:
        return_address = int.from_bytes(data[at : at + 4], "big")
        addresses = np.frombuffer(data, ">u4", reads, at + 4)
        at += 4 + 4 * reads
    return Record(write_address, written, return_address, addresses), at


def record_packet(
    tag: int, reads: bytes = b"", write_address: int = 0, written: bytes = b""
) -> bytes:
    """A packet of one record.

    Args:
        tag: return address, which the answer repeats.
        reads: byte addresses to read, big-endian.
        write_address: byte address of the first written word.
        written: words to write before the reads, big-endian.
    """
    parts = [_PLAIN, bytes((0, _ENABLES, len(written) // 4, len(reads) // 4))]
    if written:
        parts += (write_address.to_bytes(4, "big"), written)
    if reads:
        parts += (tag.to_bytes(4, "big"), reads)
    return b"".join(parts)


def answer_packet(answers: Sequence[tuple[int, bytes]]) -> bytes:
    """The answer to records that read: each one's return address, and its words, big-endian."""
    parts = [_PLAIN]
    for tag, words in answers:
        parts += (bytes((0, _ENABLES, len(words) // 4, 0)), tag.to_bytes(4, "big"), words)
    return b"".join(parts)


def answered(data: bytes) -> tuple[int, bytes] | None:
    """Return address and words (big-endian) of an answer; None for bytes that are none."""
    if len(data) < 16 or data[:4] != _PLAIN[:4]:
        return None
    count, reads = data[10], data[11]
    if reads or not count or len(data) != 16 + 4 * count:
        return None
    return int.from_bytes(data[12:16], "big"), data[16:]


def probe(tag: int) -> bytes:
    """A probe, which a board answers without an access to its bus."""
    return _PROBE + tag.to_bytes(4, "big") + _EMPTY


def probe_reply(rest: bytes) -> bytes:
    """The reply to a probe, with the bytes after the first four of the probe."""
    return _REPLY + rest
