"""Pictures and clips as users have them: of other shapes and depths, and damaged ones."""

from __future__ import annotations

import gc
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from av.stream import Disposition

from cosim import InputError
from scenarios.scenes.clips.clip import Clip
from scenarios.scenes.clips.pictures import open_clip

SHAPE = (50, 80)
RAMP = np.linspace(0, 65535, 140 * 80).reshape(140, 80).astype(np.uint16)


def test_a_portrait_picture_is_cropped_and_says_so(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "tall.png"), (RAMP >> 8).astype(np.uint8))
    clip = Clip(tmp_path / "tall.png", SHAPE)
    assert clip.notes == [
        "tall.png: 36% of the picture is filmed, cropped at the centre to the sensor's 80 x 50"
    ]
    cv2.imwrite(str(tmp_path / "wide.png"), (RAMP[45:95] >> 8).astype(np.uint8))
    assert Clip(tmp_path / "wide.png", SHAPE).notes == []


def test_a_picture_of_16_bits_keeps_them(tmp_path: Path) -> None:
    picture = np.arange(50 * 80).reshape(SHAPE).astype(np.uint16) + 30_000
    cv2.imwrite(str(tmp_path / "deep.png"), picture)
    plane = Clip(tmp_path / "deep.png", SHAPE).frame(0)
    assert plane is not None and len(np.unique(plane)) == picture.size


def test_a_picture_that_is_cut_off_is_filmed_as_far_as_it_goes(tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole.jpg", tmp_path / "cut.jpg"
    noise = np.random.default_rng(1).integers(0, 256, SHAPE, np.uint8)
    cv2.imwrite(str(whole), noise)
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    assert Clip(whole, SHAPE).notes == []
    clip = Clip(cut, SHAPE)
    assert clip.notes == ["cut.jpg is damaged: only a part of it can be decoded"]
    first, other = clip.frame(0), Clip(whole, SHAPE).frame(0)
    assert first is not None and other is not None
    assert np.array_equal(first[:16], other[:16]) and not np.array_equal(first[40:], other[40:])


@pytest.mark.parametrize("content", [b"", b"hello", b"\xff\xd8\xff\xe0"])
def test_what_is_no_picture_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "none.jpg").write_bytes(content)
    with pytest.raises(InputError, match=r"scene\.path must be a clip or image"):
        Clip(tmp_path / "none.jpg", SHAPE)


# Which way up.


def chunk(kind: bytes, body: bytes) -> bytes:
    """A part of a PNG."""
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def tiff(*pages: np.ndarray, orientation: int = 1, subfile: int = 0) -> bytes:
    """A TIFF of grey pages of uint8 or float32, a strip each; without pages the orientation only,
    as of Exif."""
    data = b"II*\0" + struct.pack("<I", 8)
    for n, page in enumerate(pages or (np.zeros((0, 0), np.uint8),)):
        floats, (height, width) = page.dtype == np.float32, page.shape
        tags = [(274, 3, orientation)]
        if pages:
            tags = [
                (254, 4, subfile if n else 0), (256, 4, width), (257, 4, height),
                (258, 3, 32 if floats else 8), (259, 3, 1), (262, 3, 1),
                (273, 4, len(data) + 2 + 13 * 12 + 4), (274, 3, orientation), (277, 3, 1),
                (278, 4, height), (279, 4, page.nbytes), (284, 3, 1), (339, 3, 3 if floats else 1),
            ]  # fmt: skip
        follows = len(data) + 6 + 12 * len(tags) + page.nbytes if n + 1 < len(pages) else 0
        data += struct.pack("<H", len(tags))
        data += b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
        data += struct.pack("<I", follows) + page.tobytes()
    return data


def oriented(path: Path, picture: np.ndarray, orientation: int) -> Path:
    """A picture with an Exif orientation, by the ending of its name."""
    if path.suffix == ".tif":
        path.write_bytes(tiff(picture, orientation=orientation))
        return path
    data = cv2.imencode(path.suffix, picture, [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()
    exif = tiff(orientation=orientation)
    if path.suffix == ".jpg":
        body = b"Exif\0\0" + exif
        data = data[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:]
    else:
        data = data[:33] + chunk(b"eXIf", exif) + data[33:]  # after IHDR
    path.write_bytes(data)
    return path


STORED: dict[int, Callable[[np.ndarray], np.ndarray]] = {
    1: lambda shown: shown,
    2: lambda shown: shown[:, ::-1],
    3: lambda shown: shown[::-1, ::-1],
    4: lambda shown: shown[::-1],
    5: lambda shown: shown.T,
    6: lambda shown: shown.T[::-1],
    7: lambda shown: shown.T[::-1, ::-1],
    8: lambda shown: shown.T[:, ::-1],
}
"""The stored picture of one that is shown, by its orientation (TIFF revision 6.0, Orientation)."""
GREY = np.linspace(0, 250, 80, dtype=np.uint8) // np.array([[1], [5]] * 25, np.uint8)
GREY[:25, :40] = 255


@pytest.mark.parametrize("orientation", STORED)
def test_a_picture_is_shown_upright_and_not_mirrored(tmp_path: Path, orientation: int) -> None:
    stored = np.ascontiguousarray(STORED[orientation](GREY))
    shown = Clip(oriented(tmp_path / "plain.png", GREY, 1), SHAPE).frame(0)
    for name in ("a.png", "a.tif", "a.jpg"):
        clip = open_clip(oriented(tmp_path / name, stored, orientation), SHAPE)
        tolerance = {"a.jpg": 0.05, "a.tif": 0.01}.get(name, 1e-6)  # a TIFF has a power of 2.2
        np.testing.assert_allclose(clip.frame(0), shown, atol=tolerance, err_msg=name)
        assert clip.notes == []
    floats = (stored / 255).astype(np.float32)
    (tmp_path / "f.tif").write_bytes(tiff(floats, orientation=orientation))
    np.testing.assert_allclose(open_clip(tmp_path / "f.tif", SHAPE).frame(0), GREY / 255, atol=1e-6)


def test_a_picture_with_a_named_profile_does_not_end_the_process(tmp_path: Path) -> None:
    """PyAV frees the name of a profile twice, when it has given the frame's side data."""
    body = b"name\0\0" + zlib.compress(bytes(16) + b"RGB XYZ " + bytes(108))
    head = chunk(b"iCCP", body), chunk(b"eXIf", tiff(orientation=2))
    grey = np.repeat(GREY[..., None], 3, axis=2)
    path = png(tmp_path / "a.png", 2, *head, lines(grey))
    for _ in range(20):
        plane = open_clip(path, SHAPE).frame(0)
        gc.collect()
    shown = Clip(oriented(tmp_path / "plain.png", GREY[:, ::-1].copy(), 1), SHAPE).frame(0)
    np.testing.assert_allclose(plane, shown, atol=1e-6)


# Which picture.


def test_pages_of_a_tiff_are_frames(tmp_path: Path) -> None:
    levels = (0, 100, 200)
    for dtype, light in ((np.uint8, 1), (np.float32, 1 / 255)):
        pages = [np.full(SHAPE, level * light, dtype) for level in levels]
        (tmp_path / "a.tif").write_bytes(tiff(*pages))
        with pytest.raises(InputError, match=r"frame_rate must be given for .*3 frames have no"):
            open_clip(tmp_path / "a.tif", SHAPE)
        clip = open_clip(tmp_path / "a.tif", SHAPE, rate=100.0)
        assert clip.rate == 100 and clip.notes == []
        for n in (2, 0, 1):
            (tmp_path / "one.tif").write_bytes(tiff(pages[n]))
            one = open_clip(tmp_path / "one.tif", SHAPE)
            np.testing.assert_array_equal(clip.frame(n), one.frame(0))
            assert one.rate == 0
        assert clip.frame(3) is None


def test_pages_that_are_no_frames_are_said(tmp_path: Path) -> None:
    (tmp_path / "preview.tif").write_bytes(tiff(GREY, GREY[:10, :10].copy(), subfile=1))
    assert open_clip(tmp_path / "preview.tif", SHAPE).notes == []
    (tmp_path / "mixed.tif").write_bytes(tiff(GREY, GREY[:, :70].copy()))
    clip = open_clip(tmp_path / "mixed.tif", SHAPE)
    assert clip.rate == 0 and clip.notes == ["mixed.tif: the first of its 2 pages is filmed"]
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "0.tif").write_bytes(tiff(GREY, GREY))
    with pytest.raises(InputError, match="several frames in a folder's file"):
        open_clip(tmp_path / "frames", SHAPE, rate=10.0).frame(0)


def test_a_tiff_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    for whole in (tiff(GREY), tiff(GREY, GREY)):
        (tmp_path / "a.tif").write_bytes(whole[:-1500])
        with pytest.raises(InputError, match=r"a\.tif \((Invalid data|page 2 cannot be decoded)"):
            open_clip(tmp_path / "a.tif", SHAPE, rate=10.0).frame(1)


NOISE = np.random.default_rng(3).integers(0, 5, SHAPE, np.uint8)


def streams(path: Path, *codecs: str, cover: bool = False) -> Path:
    """A stream of each codec: a cover of one white frame, a clip of dark frames, or sound."""
    with av.open(str(path), "w") as container:
        made: list[Any] = [
            container.add_stream(codec, rate=44100 if codec == "mp3" else 25) for codec in codecs
        ]
        for stream in made:
            if stream.type == "video":
                stream.width, stream.height = 80, 50
                still = stream.codec_context.name == "mjpeg"
                stream.pix_fmt = "yuvj420p" if still else "yuv420p"
                if still and cover:
                    stream.disposition = Disposition.attached_pic
        for stream in made:
            if stream.type == "audio":
                sound = av.AudioFrame.from_ndarray(
                    np.zeros((1, 1152), np.int16), format="s16", layout="mono"
                )
                sound.sample_rate = 44100
                container.mux(stream.encode(sound))
            else:
                moves = stream.codec_context.name != "mjpeg"
                for n in range(4 if moves else 1):
                    level = np.uint8(20 * n if moves else 250)
                    frame = av.VideoFrame.from_ndarray(NOISE + level, "gray")
                    frame.pts = n
                    container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("cover", [False, True])
@pytest.mark.parametrize("name", ["a.mp4", "a.mkv"])
def test_the_clip_is_filmed_and_not_its_cover(tmp_path: Path, name: str, cover: bool) -> None:
    clip = Clip(streams(tmp_path / name, "mjpeg", "mpeg4", cover=cover), SHAPE)
    levels = [float(clip.frame(n).max()) for n in range(4)]  # type: ignore[union-attr]
    assert levels[0] < 0.01 and levels == sorted(levels) and levels[3] < 0.1 and clip.notes == []
    timeline = clip.timeline
    assert timeline is not None and timeline.edge(3) == 120 * 10**9


def test_the_cover_of_a_song_is_no_clip(tmp_path: Path) -> None:
    path = streams(tmp_path / "a.mp3", "mp3", "mjpeg", cover=True)
    with pytest.raises(InputError, match=r"\(no picture in it other than a cover\)"):
        Clip(path, SHAPE)


def test_an_animated_webp_is_refused_by_name(tmp_path: Path) -> None:
    head = b"VP8X" + struct.pack("<IB3x3s3s", 10, 2, b"\x4f\0\0", b"\x31\0\0")
    (tmp_path / "a.webp").write_bytes(b"RIFF" + struct.pack("<I", 4 + len(head)) + b"WEBP" + head)
    with pytest.raises(InputError, match="an animated WebP, which FFmpeg does not decode"):
        open_clip(tmp_path / "a.webp", SHAPE)


# Fields, and frames that need others.


def interlaced(path: Path) -> Path:
    """A bar that moves by four pixels from field to field, bottom field first."""
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        stream.options = {"x264-params": "bff=1:log-level=-1", "qp": "1", "bf": "2", "g": "4"}
        for n in range(10):
            picture = np.full((64, 96), 30, np.uint8)
            for field in (0, 1):
                at = 4 + 8 * n + 4 * field
                picture[1 - field :: 2, at : at + 12] = 220
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "gray")))
        container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("name", ["a.mp4", "a.ts"])
def test_an_interlaced_clip_has_no_comb(tmp_path: Path, name: str) -> None:
    path = interlaced(tmp_path / name)
    clip = Clip(path, (64, 96))
    assert clip.notes == [
        f"{name} is interlaced: the first field of each frame is filmed, the lines between are "
        "interpolated (BWDIF)"
    ]
    frames = []
    while (frame := clip.frame(len(frames))) is not None:
        frames.append(frame)
    assert len(frames) == 10
    for n, frame in enumerate(frames):
        inner = frame[4:-4]
        bar = np.zeros(96, bool)
        bar[4 + 8 * n : 16 + 8 * n] = True  # where the first field has it
        assert (inner[:, bar] > 0.5).all() and (inner[:, ~bar] < 0.1).all(), n
    again = Clip(path, (64, 96))
    for n in (9, 5, 6, 2, 8, 0, 10, 9):
        found = again.frame(n)
        assert (found is None) == (n == 10)
        if found is not None:
            np.testing.assert_array_equal(found, frames[n], err_msg=f"frame {n}")


def test_a_clip_that_does_not_begin_with_a_key_frame_says_so(tmp_path: Path) -> None:
    whole = tmp_path / "whole.avi"
    with av.open(str(whole), "w") as container:
        made: Any = container.add_stream("mpeg4", rate=25)
        made.height, made.width, made.pix_fmt = *SHAPE, "yuv420p"
        for n in range(4):
            picture = np.roll(20 * NOISE, n, 1)
            container.mux(made.encode(av.VideoFrame.from_ndarray(picture, "gray")))
        container.mux(made.encode(None))
    with av.open(str(whole)) as source, av.open(str(tmp_path / "a.avi"), "w") as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in list(source.demux(source.streams.video[0]))[1:]:
            if packet.dts is not None:
                packet.stream = stream
                target.mux(packet)
    assert Clip(whole, SHAPE).notes == []
    said = "a.avi does not begin with a key frame: its first are torn"
    assert Clip(tmp_path / "a.avi", SHAPE).notes == [said]


# Transparency.


def png(path: Path, kind: int, *chunks: bytes) -> Path:
    """A PNG of 80 x 50 pixels of 8 bits of a colour type, with these chunks."""
    head = chunk(b"IHDR", struct.pack(">2I5B", 80, 50, 8, kind, 0, 0, 0))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + head + b"".join(chunks) + chunk(b"IEND", b""))
    return path


def lines(picture: np.ndarray) -> bytes:
    return chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row.tobytes() for row in picture)))


def test_transparent_parts_are_black_and_said_where_there_are_any(tmp_path: Path) -> None:
    white = np.full((*SHAPE, 4), 255, np.uint8)
    cv2.imwrite(str(tmp_path / "opaque.png"), white)
    clip = Clip(tmp_path / "opaque.png", SHAPE)
    assert clip.notes == [] and clip.frame(0).min() == 1  # type: ignore[union-attr]
    white[:, :40, 3] = 0
    cv2.imwrite(str(tmp_path / "rgba.png"), white)
    png(tmp_path / "grey.png", 4, lines(white[..., 2:]))
    entries = np.zeros(SHAPE, np.uint8)
    entries[:, :40] = 1
    palette = chunk(b"PLTE", b"\xff" * 6), chunk(b"tRNS", b"\xff\0")
    png(tmp_path / "palette.png", 3, *palette, lines(entries))
    for name in ("rgba.png", "grey.png", "palette.png"):
        clip = Clip(tmp_path / name, SHAPE)
        plane = clip.frame(0)
        assert plane is not None
        assert plane[:, :40].max() == 0 and plane[:, 40:].min() == 1, name
        assert clip.notes == [f"{name}: transparent parts are black"]
    png(tmp_path / "full.png", 3, palette[0], lines(entries))
    assert Clip(tmp_path / "full.png", SHAPE).notes == []


@pytest.mark.parametrize("codec", ["libvpx", "libvpx-vp9"])
def test_transparency_of_webm_is_black(tmp_path: Path, codec: str) -> None:
    picture = np.full((64, 96, 4), 255, np.uint8)
    picture[:, :48, 3] = 0
    with av.open(str(tmp_path / "a.webm"), "w") as container:
        stream: Any = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuva420p"
        stream.options = {"auto-alt-ref": "0", "cpu-used": "8", "g": "4"}
        for _ in range(9):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "rgba")))
        container.mux(stream.encode(None))
    clip = Clip(tmp_path / "a.webm", (64, 96))
    assert clip.notes == ["a.webm: transparent parts are black"]
    for n in (0, 8, 3):
        plane = clip.frame(n)
        assert plane is not None
        assert plane[:, :40].max() < 0.02 and plane[:, 56:].min() > 0.9
    assert clip.frame(9) is None


@pytest.mark.parametrize("kind", [np.uint16, np.float32])
def test_transparent_parts_of_a_tiff_are_black(kind: type, tmp_path: Path) -> None:
    import cv2

    most = 65535 if kind is np.uint16 else 1
    page = np.full((*SHAPE, 4), most, kind)
    page[:, : SHAPE[1] // 2, 3] = 0
    pages = [page] if kind is np.float32 else [page, page]
    assert cv2.imwritemulti(str(tmp_path / "clear.tif"), pages)
    clip = open_clip(tmp_path / "clear.tif", SHAPE, rate=None if len(pages) == 1 else 100.0)
    light = clip.frame(0)
    assert light is not None
    assert (light[:, : SHAPE[1] // 2] == 0).all()
    np.testing.assert_allclose(light[:, SHAPE[1] // 2 :], 1, rtol=1e-5)
    assert clip.notes == ["clear.tif: transparent parts are black"]
