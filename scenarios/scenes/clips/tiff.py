"""What a TIFF states of its pictures before they are decoded: sizes, pages, and floats."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

_SUBFILE, _WIDTH, _HEIGHT = 254, 256, 257
_TILE_WIDTH, _TILE_HEIGHT, _SAMPLES = 322, 323, 339
_TAGS: Final = (_SUBFILE, _WIDTH, _HEIGHT, _TILE_WIDTH, _TILE_HEIGHT, _SAMPLES)
"""Tags (TIFF revision 6.0, sections 8, 15 and 19)."""
_FORMAT: Final = {1: "B", 3: "H", 4: "I", 16: "Q"}
"""Format of a value by its type: BYTE, SHORT, LONG, and LONG8 of BigTIFF."""
_MOST: Final = 4096
"""Entries of a directory that are read."""
_MOST_PAGES: Final = 1 << 16


@dataclass(frozen=True)
class Page:
    """A picture of a TIFF.

    Attributes:
        size: (height, width), pixels.
        decoded: the same, or that of its tiles where they are larger.
        whole: whether it is a picture of its own, not a smaller copy of one or a mask.
        floats: whether its values are floats.
    """

    size: tuple[int, int]
    decoded: tuple[int, int]
    whole: bool
    floats: bool


def _directory(file: BinaryIO, at: int, order: str, big: bool) -> tuple[dict[int, int], int]:
    """The first values of a directory's entries by their tags, and the place of the next directory;
    0 for none.

    Raises:
        struct.error: the file is cut off.
    """
    entry = struct.Struct(order + ("HHQ8s" if big else "HHI4s"))
    place = struct.Struct(order + ("Q" if big else "I"))
    count = place if big else struct.Struct(order + "H")
    file.seek(at)
    (number,) = count.unpack(file.read(count.size))
    begin = file.tell()
    data = file.read(min(number, _MOST) * entry.size)
    found = {}
    for n in range(min(number, _MOST)):
        tag, kind, values, value = entry.unpack_from(data, n * entry.size)
        if kind not in _FORMAT or tag not in _TAGS:
            continue
        form = struct.Struct(order + _FORMAT[kind])
        if form.size * values > len(value):  # elsewhere in the file
            file.seek(place.unpack(value)[0])
            value = file.read(form.size)
        (found[tag],) = form.unpack_from(value)
    file.seek(begin + number * entry.size)
    following = file.read(place.size)
    return found, place.unpack(following)[0] if len(following) == place.size else 0


def tiff_pages(path: Path) -> list[Page]:
    """The pages of a TIFF, 65 536 at most; none for another file."""
    with path.open("rb") as file:
        head = file.read(16)
        order = {b"II": "<", b"MM": ">"}.get(head[:2])
        if order is None or len(head) < 16:
            return []
        (version,) = struct.unpack(order + "H", head[2:4])
        if version not in (42, 43):  # 43: BigTIFF
            return []
        (at,) = struct.unpack(*((order + "I", head[4:8]) if version == 42
                                else (order + "Q", head[8:16])))  # fmt: skip
        pages: list[Page] = []
        seen: set[int] = set()
        try:
            while at and at not in seen and len(pages) < _MOST_PAGES:
                seen.add(at)
                found, at = _directory(file, at, order, version == 43)
                if not (found.get(_HEIGHT) and found.get(_WIDTH)):
                    continue
                size = found[_HEIGHT], found[_WIDTH]
                tile = found.get(_TILE_HEIGHT, 0), found.get(_TILE_WIDTH, 0)
                pages.append(Page(
                    size, (max(size[0], tile[0]), max(size[1], tile[1])),
                    not found.get(_SUBFILE, 0) & 5, found.get(_SAMPLES) == 3,
                ))  # fmt: skip
        except (struct.error, OverflowError, OSError, ValueError):
            pass
    return pages
