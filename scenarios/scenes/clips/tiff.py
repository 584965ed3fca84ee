"""The size that a TIFF states, for a check before it is decoded."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Final

__all__ = ["tiff_size"]

_WIDTH, _HEIGHT, _TILE_WIDTH, _TILE_HEIGHT = 256, 257, 322, 323
"""Tags (TIFF revision 6.0, sections 8 and 15)."""
_FORMAT: Final = {1: "B", 3: "H", 4: "I", 16: "Q"}
"""Format of a value by its type: BYTE, SHORT, LONG, and LONG8 of BigTIFF."""
_MOST: Final = 4096
"""Entries of a directory that are read."""


def tiff_size(path: Path) -> tuple[int, int] | None:
    """(height, width) of the first picture, or of its tiles where they are larger; None for another
    file."""
    with path.open("rb") as file:
        head = file.read(16)
        order = {b"II": "<", b"MM": ">"}.get(head[:2])
        if order is None or len(head) < 16:
            return None
        (version,) = struct.unpack(order + "H", head[2:4])
        if version == 42:
            (at,), count, entry = struct.unpack(order + "I", head[4:8]), "H", "HHI4s"
        elif version == 43:  # BigTIFF
            (at,), count, entry = struct.unpack(order + "Q", head[8:16]), "Q", "HHQ8s"
        else:
            return None
        counted, entries = struct.Struct(order + count), struct.Struct(order + entry)
        try:
            file.seek(at)
            (number,) = counted.unpack(file.read(counted.size))
            found = {}
            for _ in range(min(number, _MOST)):
                tag, kind, _, value = entries.unpack(file.read(entries.size))
                if kind in _FORMAT:
                    (found[tag],) = struct.unpack_from(order + _FORMAT[kind], value)
        except (struct.error, OverflowError, OSError, ValueError):
            return None
    if not (found.get(_HEIGHT) and found.get(_WIDTH)):
        return None
    return (
        max(found[_HEIGHT], found.get(_TILE_HEIGHT, 0)), max(found[_WIDTH],
        found.get(_TILE_WIDTH, 0)),
    )  # fmt: skip
