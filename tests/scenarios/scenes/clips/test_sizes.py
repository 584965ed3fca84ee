"""Pictures of too many pixels are not decoded; pictures of extreme forms are not scaled whole."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from cosim import InputError
from scenarios.scenes.clips.fitted import Fit, _part
from scenarios.scenes.clips.pictures import open_clip
from scenarios.scenes.clips.stills import tiff_pages
from tests.measured import reading

MIB = 1 << 20
SETUP = "import av, cv2\nfrom scenarios.scenes.clips.pictures import open_clip"


def opened(path: Path) -> tuple[str, int]:
    read = f"open_clip(Path({str(path)!r}), (250, 400)).frame(0)"
    return reading(SETUP, read, 6 << 30)


def png(path: Path, width: int, height: int) -> None:
    """Writes a black picture of 8 bits without having it in memory."""
    pack = zlib.compressobj(9)
    data = b"".join(pack.compress(bytes(1 + width)) for _ in range(height)) + pack.flush()
    parts = ((b"IHDR", struct.pack(">2I5B", width, height, 8, 0, 0, 0, 0)), (b"IDAT", data),
             (b"IEND", b""))  # fmt: skip
    chunks = (
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in parts
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


def test_a_picture_of_too_many_pixels_is_not_decoded(tmp_path: Path) -> None:
    png(tmp_path / "a.png", 8192, 8193)
    assert (tmp_path / "a.png").stat().st_size < 1 << 17
    said, took = opened(tmp_path / "a.png")
    assert "(damaged, or of more than 67,108,864 pixels); check the file" in said
    assert took < 64 * MIB


def test_a_picture_takes_forty_bytes_a_pixel(tmp_path: Path) -> None:
    """As the limit of the memory assumes, for the costliest kind: floats of three colours."""
    cv2.imwrite(str(tmp_path / "a.hdr"), np.zeros((2048, 2048, 3), np.float32))
    cv2.imwrite(str(tmp_path / "a.tif"), np.zeros((2048, 2048, 3), np.float32))
    png(tmp_path / "a.png", 2048, 2048)
    for name in ("a.hdr", "a.tif", "a.png"):
        said, took = opened(tmp_path / name)
        assert said == "read" and took < 40 * 2048**2 + 48 * MIB  # FFmpeg's own, and threads


@pytest.mark.parametrize(("width", "height"), [(1500, 1), (200_000, 1), (1, 200_000), (1, 1500)])
def test_a_picture_of_one_row_or_column_is_filmed(tmp_path: Path, width: int, height: int) -> None:
    png(tmp_path / "a.png", width, height)
    said, took = opened(tmp_path / "a.png")
    assert said == "read"
    assert took < 64 * MIB


@pytest.mark.parametrize("colours", [(), (3,)])
@pytest.mark.parametrize(("height", "width"), [(3, 40), (40, 3), (1, 50), (7, 7)])
def test_a_part_of_a_scaled_picture_is_that_of_the_whole(
    height: int, width: int, colours: tuple[int, ...]
) -> None:
    light = np.random.default_rng(1).random((height, width, *colours), np.float32)
    size = width * 11, height * 11
    whole = cv2.resize(light, size, interpolation=cv2.INTER_LINEAR)
    for top, left, rows, columns in ((0, 0, 11 * height, 11), (2, 5, 9, 30), (0, 1, 3, 20)):
        part = _part(light, size, (top, left), (rows, columns))
        expected = whole[top : top + rows, left : left + columns]
        np.testing.assert_allclose(part[:, : expected.shape[1]], expected, atol=1e-6)


def test_long_pictures_are_the_same_by_both_ways(tmp_path: Path, monkeypatch) -> None:
    row = np.linspace(0, 1, 60, dtype=np.float32).reshape(2, 30)
    fit = Fit(tmp_path, (20, 30), None, True, [])
    parts = fit.on(row)
    monkeypatch.setattr("scenarios.scenes.clips.fitted._WIDEST", 1000)
    np.testing.assert_allclose(parts, fit.on(row), atol=1e-6)


def tiff(order: str, version: int, width: int, height: int) -> bytes:
    """A TIFF that has nothing but its size."""
    tags = ((256, 4, width), (257, 4, height))
    mark = b"II" if order == "<" else b"MM"
    if version == 42:
        head = mark + struct.pack(order + "HIH", 42, 8, 2)
        return head + b"".join(struct.pack(order + "HHII", t, k, 1, v) for t, k, v in tags)
    head = mark + struct.pack(order + "HHHQQ", 43, 8, 0, 16, 2)
    return head + b"".join(struct.pack(order + "HHQI4x", t, k, 1, v) for t, k, v in tags)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("version", [42, 43])
def test_the_size_of_a_tiff_is_known_before_it_is_decoded(
    tmp_path: Path, order: str, version: int
) -> None:
    data = tiff(order, version, 50_000, 40_000)
    (tmp_path / "a.tif").write_bytes(data)
    assert [page.size for page in tiff_pages(tmp_path / "a.tif")] == [(40_000, 50_000)]
    with pytest.raises(InputError, match="50000 x 40000 pixels: 67,108,864 at most are accepted"):
        open_clip(tmp_path / "a.tif", (25, 40))
    for length in range(len(data)):
        (tmp_path / "a.tif").write_bytes(data[:length])
        sizes = [page.size for page in tiff_pages(tmp_path / "a.tif")]
        assert sizes in ([], [(40_000, 50_000)])


def test_sizes_of_real_tiffs(tmp_path: Path) -> None:
    for dtype in (np.uint8, np.float32):
        cv2.imwrite(str(tmp_path / "a.tif"), np.zeros((30, 20, 3), dtype))
        (page,) = tiff_pages(tmp_path / "a.tif")
        assert page.size == (30, 20) and page.floats == (dtype == np.float32)


def test_an_array_of_too_many_pixels_is_refused(tmp_path: Path) -> None:
    np.lib.format.open_memmap(tmp_path / "a.npy", "w+", np.uint8, (8192, 8193))
    with pytest.raises(InputError, match="8193 x 8192 pixels: 67,108,864 at most are accepted"):
        open_clip(tmp_path / "a.npy", (25, 40))
