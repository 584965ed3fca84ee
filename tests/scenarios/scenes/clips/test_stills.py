"""Stills of HEIF: grids of tiles, their pose and transparency, and files that do not tell them."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from cosim import InputError
from scenarios.scenes.clips.pictures import open_clip

TILE = 64
ROWS, COLUMNS = 2, 3
SIZE = 120, 180
SHOWN = np.full((ROWS * TILE, COLUMNS * TILE), 40, np.uint8)
SHOWN[:60, 90:180] = 230
SHOWN[60:100, :30] = 150


def box(kind: bytes, *bodies: bytes, full: int | None = None) -> bytes:
    body = b"".join(bodies)
    if full is not None:
        body = struct.pack(">I", full) + body
    return struct.pack(">I4s", 8 + len(body), kind) + body


def hevc(picture: np.ndarray) -> tuple[bytes, bytes]:
    """A grey picture in HEVC: its decoder configuration (ISO/IEC 14496-15, 8.3.3), and its data."""
    encoder: Any = av.CodecContext.create("libx265", "w")
    encoder.height, encoder.width, encoder.pix_fmt = *picture.shape, "yuv420p"
    encoder.time_base, encoder.framerate = Fraction(1, 25), Fraction(25)
    encoder.options = {"x265-params": "log-level=none:qp=4:info=0:repeat-headers=1:pools=1"}
    frame = av.VideoFrame.from_ndarray(picture, "gray")
    packets = [*encoder.encode(frame), *encoder.encode(None)]
    stream = b"".join(bytes(packet) for packet in packets).replace(b"\0\0\0\1", b"\0\0\1")
    units = [(unit[0] >> 1 & 63, unit) for unit in stream.split(b"\0\0\1") if unit]
    sets = sorted((kind, unit) for kind, unit in units if kind in (32, 33, 34))
    head = bytes.fromhex("010160000000900000000000 3cf000fcfdf8f800000f 03")
    told = b"".join(struct.pack(">BHH", 128 | kind, 1, len(unit)) + unit for kind, unit in sets)
    data = (struct.pack(">I", len(unit)) + unit for kind, unit in units if kind < 32)
    return head + told, b"".join(data)


GRID = 100


def heif(
    path: Path, pose: tuple[bytes, ...] = (), alpha: np.ndarray | None = None,
    kind: bytes = b"grid", columns: int = COLUMNS, size: tuple[int, int] = SIZE,
) -> Path:  # fmt: skip
    """Writes SHOWN as a grid (ISO/IEC 23008-12, 6.6.2.3), with transparency a tile."""
    tiles = [
        SHOWN[row : row + TILE, column : column + TILE].copy()
        for row in range(0, ROWS * TILE, TILE)
        for column in range(0, COLUMNS * TILE, TILE)
    ]
    pictures = tiles if alpha is None else [tiles[0], alpha]
    coded = [hevc(picture) for picture in pictures]
    items = range(1, len(coded) + 1)
    derived = [GRID] if alpha is None else []
    primary = GRID if alpha is None else 1
    infe = [
        box(b"infe", struct.pack(">HH4s", n, 0, b"hvc1" if n < GRID else kind), b"\0", full=2 << 24)
        for n in (*items, *derived)
    ]
    references = (
        box(b"dimg", struct.pack(">HH", GRID, len(items)), struct.pack(f">{len(items)}H", *items))
        if alpha is None
        else box(b"auxl", struct.pack(">3H", 2, 1, 1))
    )
    grid = struct.pack(">4B2H", 0, 0, ROWS - 1, columns - 1, size[1], size[0])
    properties = [
        *(box(b"hvcC", told) for told, _ in coded),
        box(b"ispe", struct.pack(">2I", TILE, TILE), full=0),
        box(b"auxC", b"urn:mpeg:mpegB:cicp:systems:auxiliary:alpha\0", full=0),
        *pose,
    ]
    last = len(coded)
    poses = [last + 3 + n for n in range(len(pose))]
    associated = {n: [n, last + 1] for n in items}
    if alpha is not None:
        associated[2].append(last + 2)
    associated.setdefault(primary, []).extend(poses)
    ipma = b"".join(
        struct.pack(">HB", n, len(each)) + bytes(each) for n, each in sorted(associated.items())
    )

    def meta(at: int) -> bytes:
        places = b""
        for n, (_, data) in zip(items, coded, strict=True):
            places += struct.pack(">4H2I", n, 0, 0, 1, at, len(data))
            at += len(data)
        for n in derived:
            places += struct.pack(">4H2I", n, 1, 0, 1, 0, len(grid))
        count = struct.pack(">H", len(items) + len(derived))
        return box(
            b"meta", box(b"hdlr", struct.pack(">I4s12x", 0, b"pict"), b"\0", full=0),
            box(b"pitm", struct.pack(">H", primary), full=0),
            box(b"iloc", b"\x44\0", count, places, full=1 << 24),
            box(b"iinf", count, *infe, full=0), box(b"iref", references, full=0),
            box(b"iprp", box(b"ipco", *properties),
                box(b"ipma", struct.pack(">I", len(associated)), ipma, full=0)),
            box(b"idat", grid), full=0,
        )  # fmt: skip

    brand = box(b"ftyp", b"heic", bytes(4), b"mif1heic")
    begin = len(brand) + len(meta(0)) + 8
    path.write_bytes(brand + meta(begin) + box(b"mdat", *(data for _, data in coded)))
    return path


def srgb(code: np.ndarray) -> np.ndarray:
    """Linear light of 8-bit sRGB codes above 10 (IEC 61966-2-1)."""
    return ((code / 255 + 0.055) / 1.055) ** 2.4


IROT, IMIR = (lambda turns: box(b"irot", bytes([turns]))), (lambda way: box(b"imir", bytes([way])))
POSES = {
    "as stored": ((), lambda p: p),
    "90 degrees counterclockwise": ((IROT(1),), np.rot90),
    "left and right exchanged": ((IMIR(1),), np.fliplr),
    "top and bottom exchanged": ((IMIR(0),), np.flipud),
    "turned, then mirrored": ((IROT(1), IMIR(1)), lambda p: np.fliplr(np.rot90(p))),
    "mirrored, then turned": ((IMIR(0), IROT(3)), lambda p: np.rot90(np.flipud(p), 3)),
}


@pytest.mark.parametrize("name", POSES)
def test_a_grid_of_tiles_is_one_picture(tmp_path: Path, name: str) -> None:
    pose, shown = POSES[name]
    expected = srgb(shown(SHOWN[: SIZE[0], : SIZE[1]]).astype(float))
    clip = open_clip(heif(tmp_path / "a.heic", pose), expected.shape)
    assert clip.size == SIZE and clip.notes == [] and clip.rate == 0
    plane = clip.frame(0)
    assert plane is not None
    assert np.abs(plane - expected).mean() < 0.01  # edges within a tile are coded with loss
    np.testing.assert_allclose(np.median(plane), np.median(expected), atol=0.01)


def test_a_still_of_one_item_has_its_transparency_and_pose(tmp_path: Path) -> None:
    alpha = np.zeros((TILE, TILE), np.uint8)
    alpha[:32] = 235  # limited range
    path = heif(tmp_path / "a.heic", (IROT(1),), np.where(alpha, 255, 0).astype(np.uint8))
    clip = open_clip(path, (TILE, TILE))
    assert clip.notes == ["a.heic: transparent parts are black"]
    plane = clip.frame(0)
    assert plane is not None
    light = srgb(np.array([40.0]))[0]
    np.testing.assert_allclose(plane[:, :30], light, atol=0.01)  # the upper half, turned
    np.testing.assert_allclose(plane[:, 34:], 0, atol=0.01)


def test_what_cannot_be_composed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"composed by iovl, of which no part is whole: export it"):
        open_clip(heif(tmp_path / "a.heic", kind=b"iovl"), SIZE)
    for wrong in ({"columns": 2}, {"size": (129, 180)}, {"size": (60, 180)}):
        with pytest.raises(InputError, match=r"\(damaged: "):
            open_clip(heif(tmp_path / "a.heic", **wrong), SIZE)  # type: ignore[arg-type]


def test_a_still_that_is_damaged_is_one_line_or_a_picture(tmp_path: Path) -> None:
    whole = heif(tmp_path / "whole.heic").read_bytes()
    random = np.random.default_rng(1)
    for n in range(60):
        data = bytearray(whole)
        if n % 2:
            data = data[: int(random.integers(0, len(whole)))]
        else:  # in the description
            for at in random.integers(0, 900, 3):
                data[at] = int(random.integers(0, 256))
        (tmp_path / "a.heic").write_bytes(data)
        try:
            plane = open_clip(tmp_path / "a.heic", (25, 40)).frame(0)
        except InputError as exc:
            assert "\n" not in str(exc)
        else:
            assert plane is not None and np.isfinite(plane).all()
