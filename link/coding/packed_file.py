"""A file as the bytes that the fountain code sends: its CRC, its name and its data. A name that
arrives is made safe to write, whatever its origin.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import Final

from link.coding.crc import crc32c, crc64_xz

NAME_BYTES: Final = 120
"""Largest size of a name in UTF-8: well below the 255 bytes of common file systems."""
_NAMELESS: Final = "file"
_UNWANTED: Final = re.compile(r'[<>:"|?*]')
_DEVICES: Final = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
"""Names that Windows reserves for devices."""
MOST_BYTES: Final = 2**30
"""Largest number of bytes of the fountain: the decoder's tables grow with the length in a
header."""
_HEAD: Final = struct.Struct("<QB")


def pack_file(data: bytes, name: str) -> tuple[int, bytes]:
    """Session's number, and the bytes for the fountain: CRC, name and data. Never empty."""
    called = safe_name(name).encode()
    body = called + data
    packed = _HEAD.pack(crc64_xz(bytes([len(called)]) + body), len(called)) + body
    if len(packed) > MOST_BYTES:
        raise ValueError(
            f"the file must be at most {MOST_BYTES // 2**20} MiB, not {len(data)} bytes"
        )
    return crc32c(_HEAD.pack(len(packed), len(called)) + packed[: _HEAD.size] + called), packed


def unpack_file(packed: bytes) -> Delivered | None:
    """File; None if the CRC is wrong."""
    if len(packed) < _HEAD.size:
        return None
    crc, called = _HEAD.unpack_from(packed)
    body = packed[_HEAD.size :]
    if called > min(len(body), NAME_BYTES) or crc64_xz(bytes([called]) + body) != crc:
        return None
    return Delivered(body[called:], safe_name(body[:called].decode(errors="replace")))


@dataclass(frozen=True)
class Delivered:
    """A file that arrived whole.

    Attributes:
        data: its bytes.
        name: a name that is safe to write.
    """

    data: bytes
    name: str


def safe_name(name: str) -> str:
    """Last part of a path, as a name that stays in the folder it is written to.

    Characters that a file system refuses, that control a terminal or reverse the direction of text
    become "_". An empty result becomes "file".
    """
    last = re.split(r"[/\\]", name)[-1]
    safe = "".join(c if c.isprintable() else "_" for c in last)
    safe = _UNWANTED.sub("_", safe).rstrip(" .").lstrip()
    if not safe or _DEVICES.match(safe):
        safe = _NAMELESS + safe
    stem, dot, ending = safe.rpartition(".")
    if not dot or not stem or len(ending.encode()) > NAME_BYTES // 4:
        stem, dot, ending = safe, "", ""
    room = NAME_BYTES - len((dot + ending).encode())
    return (stem.encode()[:room].decode(errors="ignore") + dot + ending).rstrip(" .")
