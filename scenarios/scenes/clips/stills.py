"""What files of still pictures state before they are decoded: HEIF (HEIC, AVIF; ISO/IEC 23008-12)
and TIFF.

A phone stores a picture as a grid of tiles, each an item of its own. FFmpeg gives the tiles, but
PyAV 18 does not give their places, so they are read here, from the boxes of the file.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import numpy.typing as npt

from scenarios.scenes.clips.fitted import AS_STORED, CONVERTING, DECODING, Fit, Pose, pose_of
from scenarios.scenes.clips.frame_converter import FrameConverter

_MOST_HEIF: Final = 1 << 24
"""Bytes of a description that are read."""
_CODED: Final = (b"hvc1", b"hev1", b"av01", b"avc1", b"jpeg")
_ALPHA: Final = b":alpha", b"hevc:2015:auxid:1"
"""Ends of the types of auxiliary items of transparency (ISO/IEC 23008-12, 6.6.2.1)."""
_SUBFILE, _WIDTH, _HEIGHT = 254, 256, 257
_TILE_WIDTH, _TILE_HEIGHT, _SAMPLES = 322, 323, 339
_TAGS: Final = (_SUBFILE, _WIDTH, _HEIGHT, _TILE_WIDTH, _TILE_HEIGHT, _SAMPLES)
"""Tags (TIFF revision 6.0, sections 8, 15 and 19)."""
_FORMAT: Final = {1: "B", 3: "H", 4: "I", 16: "Q"}
"""Format of a value by its type: BYTE, SHORT, LONG, and LONG8 of BigTIFF."""
_MOST_TIFF: Final = 4096
"""Entries of a directory that are read."""
_MOST_PAGES: Final = 1 << 16


@dataclass(frozen=True)
class Tiles:
    """Items that make a plane, row by row; `shape` is its (height, width), None for an item's."""

    items: tuple[int, ...]
    columns: int = 1
    shape: tuple[int, int] | None = None


@dataclass(frozen=True)
class Still:
    """A picture: its tiles, those of its transparency, and its pose if it is a grid."""

    colours: Tiles
    alpha: Tiles | None
    pose: Pose


def _boxes(data: bytes, at: int = 0) -> Iterator[tuple[bytes, bytes]]:
    """Kinds and contents of the boxes in the content of a box."""
    while at + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        head = 8
        if size == 1:
            (size,), head = struct.unpack_from(">Q", data, at + 8), 16
        size = size or len(data) - at
        if size < head:
            return
        yield kind, data[at + head : at + size]
        at += size


def _meta(file: BinaryIO) -> bytes | None:
    """Content of the box that describes a file's pictures; None for another file, and for one with
    frames in time."""
    found = None
    while True:
        head = file.read(16)
        if len(head) < 8:
            return found
        size, kind = struct.unpack_from(">I4s", head)
        length = 8
        if size == 1 and len(head) == 16:
            (size,), length = struct.unpack_from(">Q", head, 8), 16
        if (file.tell() == len(head) and kind != b"ftyp") or kind == b"moov":
            return None
        if kind == b"meta" and found is None and size <= _MOST_HEIF:
            file.seek(length - len(head), 1)
            found = file.read(size - length)
            continue
        if size < length:  # to the end of the file
            return found
        file.seek(size - len(head), 1)


class _Description:
    """The boxes of a picture's description, as far as they tell what it is composed of.

    Raises:
        struct.error, ValueError, IndexError, KeyError: the description is damaged.
    """

    def __init__(self, meta: bytes, file: BinaryIO) -> None:
        self._boxes = dict(_boxes(meta, 4))
        self._file = file
        pitm = self._boxes[b"pitm"]
        self.primary = int.from_bytes(pitm[4:6] if pitm[0] == 0 else pitm[4:8], "big")
        self.kinds = dict(self._entries())
        self._references = list(self._from_to())

    def _entries(self) -> Iterator[tuple[int, bytes]]:
        iinf = self._boxes[b"iinf"]
        for kind, entry in _boxes(iinf, 6 if iinf[0] == 0 else 8):
            if kind == b"infe" and entry[0] in (2, 3):
                wide = 2 if entry[0] == 2 else 4
                number = int.from_bytes(entry[4 : 4 + wide], "big")
                yield number, entry[6 + wide : 10 + wide]

    def _from_to(self) -> Iterator[tuple[bytes, int, tuple[int, ...]]]:
        iref = self._boxes.get(b"iref", bytes(4))
        form = "H" if iref[0] == 0 else "I"
        wide = struct.calcsize(">" + form)
        for kind, body in _boxes(iref, 4):
            begin, count = struct.unpack_from(f">{form}H", body)
            yield kind, begin, struct.unpack_from(f">{count}{form}", body, wide + 2)

    def properties(self, item: int) -> list[tuple[bytes, bytes]]:
        """Properties of an item in their order."""
        inner = list(_boxes(self._boxes[b"iprp"]))
        known = list(_boxes(dict(inner)[b"ipco"]))
        found = []
        for ipma in (body for kind, body in inner if kind == b"ipma"):
            form = ">I" if ipma[0] else ">H"
            double = ipma[3] & 1
            (count,), at = struct.unpack_from(">I", ipma, 4), 8
            for _ in range(count):
                (number,) = struct.unpack_from(form, ipma, at)
                at += struct.calcsize(form)
                many, at = ipma[at], at + 1
                for _ in range(many):
                    index = int.from_bytes(ipma[at : at + 1 + double], "big")
                    index &= 0x7FFF if double else 0x7F
                    at += 1 + double
                    if number == item and index:
                        found.append(known[index - 1])
        return found

    def _data(self, item: int) -> bytes:
        """The bytes of an item, of a grid a few."""
        iloc = self._boxes[b"iloc"]
        version, sizes = iloc[0], iloc[4:6]
        of_offset, of_length = sizes[0] >> 4, sizes[0] & 15
        of_base, of_index = sizes[1] >> 4, sizes[1] & 15 if version else 0
        at = 6

        def number(size: int) -> int:
            nonlocal at
            if at + size > len(iloc):
                raise ValueError
            at += size
            return int.from_bytes(iloc[at - size : at], "big")

        for _ in range(number(2 if version < 2 else 4)):
            found = number(2 if version < 2 else 4)
            method = number(2) & 15 if version else 0
            number(2)
            base, parts = number(of_base), b""
            for _ in range(number(2)):
                number(of_index)
                offset, length = base + number(of_offset), number(of_length)
                if found != item:
                    continue
                if method == 1:
                    parts += self._boxes[b"idat"][offset : offset + length]
                else:
                    self._file.seek(offset)
                    parts += self._file.read(min(length, _MOST_HEIF))
            if found == item:
                return parts
        raise KeyError(item)

    def tiles(self, item: int) -> Tiles:
        """The tiles of an item. Raises NotImplementedError for another kind of derived item."""
        kind = self.kinds[item]
        if kind != b"grid":
            if kind not in _CODED:
                raise NotImplementedError(kind.decode("latin-1"))
            return Tiles((item,))
        data = self._data(item)
        rows, columns = data[2] + 1, data[3] + 1
        width, height = struct.unpack_from(">II" if data[1] & 1 else ">HH", data, 4)
        parts = next(to for what, by, to in self._references if (what, by) == (b"dimg", item))
        if len(parts) != rows * columns or not (width and height):
            raise ValueError
        return Tiles(parts, columns, (height, width))

    def alpha(self) -> Tiles | None:
        """The tiles of the transparency of the primary item."""
        for kind, begin, to in self._references:
            if kind == b"auxl" and self.primary in to:
                kinds = [body for name, body in self.properties(begin) if name == b"auxC"]
                if any(body[4:].split(b"\0")[0].endswith(_ALPHA) for body in kinds):
                    return self.tiles(begin)
        return None

    def pose(self) -> Pose:
        """How the primary item is turned upright, by its properties in their order."""
        mirrored, turns = AS_STORED
        for kind, body in self.properties(self.primary):
            if kind == b"irot":
                turns = (turns + body[0]) % 4
            elif kind == b"imir":  # 0 exchanges top and bottom, 1 left and right
                mirrored, turns = not mirrored, (2 * (1 - (body[0] & 1)) - turns) % 4
        return mirrored, turns


def still_in(path: Path, fit: Fit) -> Still | None:
    """The picture of a HEIF file; None for another file, and for one with frames in time.

    Raises:
        InputError: its description is damaged, or of a kind that cannot be composed.
    """
    try:
        with path.open("rb") as file:
            meta = _meta(file)
            if meta is None or b"pitm" not in dict(_boxes(meta, 4)):
                return None
            told = _Description(meta, file)
            colours = told.tiles(told.primary)
            return Still(colours, told.alpha(), told.pose())
    except NotImplementedError as exc:
        raise fit.bad(f"a picture composed by {exc}, of which no part is whole: export it") \
            from None  # fmt: skip
    except (struct.error, ValueError, IndexError, KeyError, OSError, StopIteration):
        raise fit.bad("damaged: what its parts are is not told") from None


def decoded_still(
    path: Path, still: Still, coded: FrameConverter, fit: Fit
) -> tuple[npt.NDArray[np.float32], Pose]:
    """Linear light of a picture, (H, W) or (H, W, 3) with colours, and how it is turned upright.

    Raises:
        InputError: a part of it cannot be decoded.
    """
    import av

    wanted = {*still.colours.items, *(still.alpha.items if still.alpha else ())}
    frames: dict[int, Any] = {}
    try:
        with av.open(str(path), options=DECODING) as container:
            streams = [each for each in container.streams.video if each.id in wanted]
            for each in streams:
                each.codec_context.options = DECODING
                fit.check_size(each.codec_context.height * len(streams), each.codec_context.width)
            for packet in container.demux(streams) if streams else ():
                for frame in packet.decode():
                    frames.setdefault(packet.stream.id, frame)
    except (av.FFmpegError, OSError, ValueError, MemoryError) as exc:
        raise fit.undecodable(exc) from None
    if wanted - frames.keys():
        raise fit.bad(f"damaged: {len(wanted - frames.keys())} of its {len(wanted)} parts missing")
    items = dict.fromkeys(still.colours.items)
    light = _composed(still.colours, {item: coded.light(frames[item]) for item in items}, fit)
    if still.alpha is not None:
        share = {
            item: frames[item].to_ndarray(format="gray", **CONVERTING) for item in still.alpha.items
        }
        alpha = _composed(still.alpha, share, fit) / np.float32(255)
        if alpha.shape == light.shape[:2] and alpha.min(initial=1) < 1:
            light = light * (alpha[..., None] if light.ndim == 3 else alpha)
            fit.note(f"{path.name}: transparent parts are black")
    pose = still.pose if still.colours.shape else pose_of(frames[still.colours.items[0]])
    return light, pose


def _composed(tiles: Tiles, planes: dict[int, npt.NDArray[Any]], fit: Fit) -> npt.NDArray[Any]:
    """The planes of tiles side by side, cut to their shape."""
    parts = [planes[item] for item in tiles.items]
    if tiles.shape is None:
        return parts[0]
    height, width = parts[0].shape[:2]
    rows = len(parts) // tiles.columns
    fills = (rows - 1) * height < tiles.shape[0] <= rows * height
    fills &= (tiles.columns - 1) * width < tiles.shape[1] <= tiles.columns * width
    if not fills or any(part.shape != parts[0].shape for part in parts):
        raise fit.bad("damaged: its tiles do not fill it")
    lines = [
        np.concatenate(parts[n : n + tiles.columns], axis=1)
        for n in range(0, len(parts), tiles.columns)
    ]
    return np.concatenate(lines)[: tiles.shape[0], : tiles.shape[1]]


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
    data = file.read(min(number, _MOST_TIFF) * entry.size)
    found = {}
    for n in range(min(number, _MOST_TIFF)):
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
