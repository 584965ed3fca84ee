"""Clips as scenes: linear light, cover and crop, interpolation in time, clips that are none."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import PS, Block, Clock, InputError
from cosim.stage import blocks
from scenarios.scenes.clips.clip import Clip
from scenarios.scenes.clips.film import FilmSource

CLOCK = Clock(40_000)
SHAPE = (8, 16)
LUX = 500.0


def srgb(code: Any) -> Any:
    """Linear light of an 8-bit sRGB code (IEC 61966-2-1)."""
    v = np.asarray(code) / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def flat(*codes: int, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    """Frames of one grey each."""
    return np.stack([np.full(shape, code, np.uint8) for code in codes])


def first_frame(path: Path, shape: tuple[int, int]) -> np.ndarray:
    frame = Clip(path, shape).frame(0)
    assert frame is not None
    assert (frame.shape, frame.dtype) == (shape, np.float32)
    return frame


# What a frame becomes.


def test_every_code_becomes_linear_by_the_srgb_curve(tmp_path, make_clip):
    ramp = np.tile(np.arange(256, dtype=np.uint8), (4, 1))
    frame = first_frame(make_clip(tmp_path / "a.mkv", ramp[None]), (4, 256))
    np.testing.assert_allclose(frame, np.tile(srgb(np.arange(256)), (4, 1)), atol=1e-7)


@pytest.mark.parametrize(("channel", "weight"), [(0, 0.2126), (1, 0.7152), (2, 0.0722)])
def test_colour_becomes_bt709_luminance_of_linear_light(tmp_path, make_clip, channel, weight):
    pixels = np.zeros((1, *SHAPE, 3), np.uint8)
    pixels[..., channel] = 128
    frame = first_frame(make_clip(tmp_path / "a.mkv", pixels), SHAPE)
    np.testing.assert_allclose(frame, weight * srgb(128), rtol=1e-5)


def test_a_clip_marked_as_linear_stays_as_it_is(tmp_path):
    with av.open(str(tmp_path / "a.mkv"), "w") as container:
        stream: Any = container.add_stream("ffv1", rate=25)
        stream.height, stream.width, stream.pix_fmt = *SHAPE, "gray"
        stream.codec_context.color_trc = 8  # H.273: linear
        frame = av.VideoFrame.from_ndarray(flat(128)[0], format="gray")
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    np.testing.assert_allclose(first_frame(tmp_path / "a.mkv", SHAPE), 128 / 255, rtol=1e-6)


@pytest.mark.parametrize(
    ("pixels", "depth", "black", "white", "full"),
    [
        ("gray", 8, 0, 255, None),
        ("gray", 8, 16, 235, False),
        ("gray10le", 10, 0, 1023, True),
        ("gray10le", 10, 64, 940, False),
        ("gray16le", 16, 0, 65535, None),
        ("bgr0", 8, 0, 255, None),
        ("gbrp10le", 10, 0, 1023, None),
        ("gbrp16le", 16, 0, 65535, None),
        ("yuv420p", 8, 16, 235, None),  # BT.709-6, item 5.6: limited range
        ("yuv420p", 8, 0, 255, True),
        ("yuv444p", 8, 16, 235, None),
        ("yuv420p10le", 10, 64, 940, None),
        ("yuv420p10le", 10, 0, 1023, True),
        ("yuv444p12le", 12, 0, 4095, True),
        ("yuv422p10le", 10, 64, 940, None),
        ("yuvj420p", 8, 0, 255, None),
    ],
)
def test_black_is_0_and_white_is_1_however_a_clip_stores_them(
    tmp_path, pixels, depth, black, white, full
):
    codec = "mjpeg" if pixels == "yuvj420p" else "ffv1"
    with av.open(str(tmp_path / "a.mkv"), "w") as container:
        stream: Any = container.add_stream(codec, rate=25)
        stream.height, stream.width, stream.pix_fmt = 16, 32, pixels
        if full is not None:
            stream.codec_context.color_range = 2 if full else 1
        for level in (black, white, (black + white) // 2):
            frame = av.VideoFrame(32, 16, pixels)
            for n, plane in enumerate(frame.planes):
                code = 1 << (depth - 1) if n and "yuv" in pixels else level
                one = code.to_bytes(1 if depth == 8 else 2, "little")
                plane.update(one * (plane.buffer_size // len(one)))
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    clip = Clip(tmp_path / "a.mkv", SHAPE)
    np.testing.assert_array_equal(clip.frame(0), 0)
    np.testing.assert_allclose(clip.frame(1), 1, atol=1e-6)
    # FFmpeg's YUV to RGB is right to a code, whose slope here is 2.2 x 0.5^1.2 / 255.
    np.testing.assert_allclose(clip.frame(2), srgb(127.5), atol=1.5 * 2.2 * 0.5**1.2 / 255)


def coded(path: Path, curve: int, primaries: int, *codes: tuple[int, int, int]) -> Clip:
    """Frames of one colour each, green, blue and red of 10 bits."""
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("ffv1", rate=25)
        stream.height, stream.width, stream.pix_fmt = 16, 32, "gbrp10le"
        stream.codec_context.color_trc = curve
        stream.codec_context.color_primaries = primaries
        for code in codes:
            frame = av.VideoFrame(32, 16, "gbrp10le")
            for plane, value in zip(frame.planes, code, strict=True):
                plane.update(value.to_bytes(2, "little") * (plane.buffer_size // 2))
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return Clip(path, SHAPE)


def test_white_of_hdr_is_1_and_light_above_it_is_kept(tmp_path):
    # PQ: BT.2408-7, table 1, has 58 % for 203 cd/m2, and BT.2100-2 10 000 cd/m2 for 100 %.
    clip = coded(tmp_path / "pq.mkv", 16, 1, *((round(1023 * v),) * 3 for v in (0, 0.58, 1)))
    levels = [float(clip.frame(n).mean()) for n in range(3)]
    assert levels == pytest.approx([0, 1, 10_000 / 203], rel=0.02)
    assert clip.notes == ["pq.mkv is PQ, white at 203 cd/m2 (ITU-R BT.2408)"]
    # HLG: the scene of a signal of 50 % has a twelfth of the light of 100 % (BT.2100-2, table 5).
    clip = coded(tmp_path / "hlg.mkv", 18, 1, *((round(1023 * v),) * 3 for v in (0, 0.5, 0.75, 1)))
    levels = [float(clip.frame(n).mean()) for n in range(4)]
    assert levels[2] == pytest.approx(1, rel=0.01)
    assert levels[1] == pytest.approx(levels[3] / 12, rel=0.01) and levels[0] == 0
    assert clip.notes == ["hlg.mkv is HLG, white at a signal of 75 % (ITU-R BT.2408)"]


@pytest.mark.parametrize(
    ("primaries", "green"), [(1, 0.7152), (9, 0.6780), (12, 0.6917)]
)  # BT.709; BT.2020-2, table 4; Display P3
def test_colours_of_other_primaries_have_their_own_luminance(tmp_path, primaries, green):
    clip = coded(tmp_path / "a.mkv", 13, primaries, (1023, 0, 0), (1023, 1023, 1023))
    np.testing.assert_allclose(clip.frame(0), green, atol=2e-4)
    np.testing.assert_allclose(clip.frame(1), 1, atol=2e-4)


def test_a_matrix_that_is_not_converted_is_named(tmp_path):
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("ffv1", rate=25)
        stream.height, stream.width, stream.pix_fmt = 16, 32, "yuv444p"
        stream.codec_context.colorspace = 8  # YCgCo
        container.mux(stream.encode(av.VideoFrame(32, 16, "yuv444p")))
        container.mux(stream.encode(None))
    with pytest.raises(InputError, match=r"colours by matrix 8 of ITU-T H\.273, table 4, which"):
        Clip(path, SHAPE)


def test_a_wide_clip_loses_its_sides_and_a_tall_one_top_and_bottom(tmp_path, make_clip):
    wide = np.tile(np.arange(24, dtype=np.uint8) * 10, (8, 1))
    frame = first_frame(make_clip(tmp_path / "wide.mkv", wide[None]), (8, 8))
    np.testing.assert_allclose(frame, np.tile(srgb(wide[0, 8:16]), (8, 1)), atol=1e-7)
    frame = first_frame(make_clip(tmp_path / "tall.mkv", wide.T[None].copy()), (8, 8))
    np.testing.assert_allclose(frame, np.tile(srgb(wide[0, 8:16]), (8, 1)).T, atol=1e-7)


def test_shrinking_averages_light_and_not_codes(tmp_path, make_clip):
    board = (np.indices((16, 32)).sum(axis=0) % 2 * 255).astype(np.uint8)
    np.testing.assert_allclose(first_frame(make_clip(tmp_path / "a.mkv", board[None]), SHAPE), 0.5)


def test_enlarging_interpolates_between_the_centres_of_pixels(tmp_path, make_clip):
    row = np.array([0, 50, 100, 150, 200, 250, 100, 0], np.uint8)
    frame = first_frame(make_clip(tmp_path / "a.mkv", np.tile(row, (4, 1))[None]), SHAPE)
    at = (np.arange(16) + 0.5) / 2 - 0.5
    expected = np.interp(at, np.arange(8), srgb(row))
    np.testing.assert_allclose(frame, np.tile(expected, (8, 1)), atol=1e-6)


def test_pixels_that_are_not_square_are_shown_as_wide_as_they_are(tmp_path, make_clip):
    rows = np.repeat(np.arange(8, dtype=np.uint8)[:, None] * 30, 8, axis=1)
    path = make_clip(tmp_path / "a.mov", rows[None], codec="png", aspect=Fraction(2))
    expected = np.tile(srgb(rows[:, :1]), (1, 16))  # 8x8 of 2:1 pixels fill 16x8: nothing is lost
    np.testing.assert_allclose(first_frame(path, SHAPE), expected, atol=1e-6)


POSES = {
    # Exif orientation: QuickTime matrix a, b, c, d, and the stored picture of one that is shown;
    # x' = a x + c y, y' = b x + d y; x to the right, y down.
    1: ((1, 0, 0, 1), lambda shown: shown),
    2: ((-1, 0, 0, 1), lambda shown: shown[:, ::-1]),
    3: ((-1, 0, 0, -1), lambda shown: shown[::-1, ::-1]),
    4: ((1, 0, 0, -1), lambda shown: shown[::-1]),
    5: ((0, 1, 1, 0), lambda shown: shown.T),
    6: ((0, 1, -1, 0), lambda shown: shown.T[::-1]),
    7: ((0, -1, -1, 0), lambda shown: shown.T[::-1, ::-1]),
    8: ((0, -1, 1, 0), lambda shown: shown.T[:, ::-1]),
}


@pytest.mark.parametrize("pose", POSES)
def test_a_clip_that_is_marked_as_turned_or_mirrored_is_shown_upright(tmp_path, make_clip, pose):
    (a, b, c, d), stored_of = POSES[pose]
    shown = np.arange(128, dtype=np.uint8).reshape(SHAPE) * 2
    stored = stored_of(shown).copy()
    path = make_clip(tmp_path / "a.mov", np.stack([stored] * 2), codec="png")
    content = bytearray(path.read_bytes())
    matrix = content.index(b"tkhd") + 4 + 40  # ISO/IEC 14496-12, track header of version 0
    one = 1 << 16
    assert struct.unpack_from(">9i", content, matrix) == (one, 0, 0, 0, one, 0, 0, 0, 1 << 30)
    struct.pack_into(
        ">9i", content, matrix, a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30
    )
    path.write_bytes(content)
    np.testing.assert_allclose(first_frame(path, SHAPE), srgb(shown), atol=1e-6)


def test_frames_come_in_any_order_and_as_often_as_asked(tmp_path, make_clip):
    codes = list(range(0, 240, 20))
    clip = Clip(make_clip(tmp_path / "a.mkv", flat(*codes)), SHAPE)
    for n in (0, 5, 3, 3, 11, 10, 0, 11, 12, 11, 40, 2):
        frame = clip.frame(n)
        if n < len(codes):
            np.testing.assert_allclose(frame, srgb(codes[n]), atol=1e-6)
        else:
            assert frame is None
    clip.frame(99)
    np.testing.assert_allclose(clip.last(), srgb(codes[-1]), atol=1e-6)


def test_frames_that_are_passed_over_are_not_made_linear(tmp_path, make_clip, monkeypatch):
    clip = Clip(make_clip(tmp_path / "a.mkv", flat(*range(60))), SHAPE)
    made = []
    linear = Clip._linear
    monkeypatch.setattr(Clip, "_linear", lambda *given: made.append(1) or linear(*given))
    np.testing.assert_allclose(clip.frame(50), srgb(50), atol=1e-6)
    np.testing.assert_allclose(clip.frame(51), srgb(51), atol=1e-6)
    assert len(made) == 2


# What is no clip.


def sound(path: Path) -> None:
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("pcm_s16le", rate=8000, layout="mono")
        silence = np.zeros((1, 800), np.int16)
        frame = av.AudioFrame.from_ndarray(silence, format="s16", layout="mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


NO_CLIPS = {
    "random.mp4": lambda path: path.write_bytes(np.random.default_rng(1).bytes(50_000)),
    "empty.mp4": lambda path: path.touch(),
    "text.mp4": lambda path: path.write_text("no clip\n" * 100),
    "text.txt": lambda path: path.write_text("no clip\n" * 100),
    "picture.png": lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"\0" * 100),
    "folder.mp4": lambda path: path.mkdir(),
    "sound.wav": sound,
    "missing.mp4": lambda path: None,
    "x" * 300: lambda path: None,
}


@pytest.mark.parametrize("name", NO_CLIPS)
def test_what_is_no_clip_is_refused_by_name(tmp_path, name):
    NO_CLIPS[name](tmp_path / name)
    with pytest.raises(InputError) as caught:
        Clip(tmp_path / name, SHAPE)
    assert caught.value.actual.startswith(f"{tmp_path / name} (")
    said = str(caught.value)
    assert said.startswith(
        f"scene.path must be a clip or image that can be decoded, not {str(tmp_path / name)[:100]}"
    )
    assert said.endswith("); check the file, or leave scene.path out for the built-in scene")


def test_a_clip_cut_short_is_used_as_far_as_it_goes(tmp_path, make_clip):
    noise = np.random.default_rng(1).integers(0, 256, (40, *SHAPE), np.uint8)
    whole = make_clip(tmp_path / "whole.mkv", noise).read_bytes()
    cut = tmp_path / "cut.mkv"
    cut.write_bytes(whole[: len(whole) // 2])
    source = FilmSource(cut, SHAPE, LUX, CLOCK, 60_000)  # 1.5 s, as long as the whole one
    light = [source.step(None, Block(start, 1_000)) for start in range(0, 60_000, 1_000)]
    known = source._clip.count
    assert 5 < known < 35
    np.testing.assert_array_equal(
        light[-1].at(CLOCK.edge(59_500)), source._clip.last() * np.float32(LUX)
    )
    np.testing.assert_allclose(source._clip.last(), srgb(noise[known - 1]), atol=1e-6)
    assert len(source.degraded) == 1


# Frames in time.

RATES = [Fraction(25), Fraction(30_000, 1001), Fraction(24_000, 1001), Fraction(1000)]


@pytest.mark.parametrize("rate", RATES, ids=str)
def test_light_runs_linearly_between_frames_at_their_true_instants(tmp_path, make_clip, rate):
    codes = [0, 255, 64, 128, 30, 200]
    levels = srgb(codes)
    path = make_clip(tmp_path / "a.mkv", flat(*codes), rate=rate)
    cycles = int(CLOCK.hz * 4.5 / rate)
    source = FilmSource(path, SHAPE, LUX, CLOCK, cycles)
    edges = [k * PS * rate.denominator // rate.numerator for k in range(len(codes))]
    for share in (0, 0.1, 0.5, 0.99):
        for k in range(4):
            ps = edges[k] + round(share * (edges[k + 1] - edges[k]))
            expected = levels[k] + share * (levels[k + 1] - levels[k])
            np.testing.assert_allclose(source.truth(ps), expected, atol=1e-6)
            cycle = CLOCK.cycle_at(ps)
            light = source.step(None, Block(cycle, 1))
            np.testing.assert_array_equal(light.at(ps), source.step(None, Block(cycle, 1)).at(ps))
            np.testing.assert_allclose(light.at(ps), LUX * source.truth(ps), rtol=1e-5, atol=1e-4)
    assert source.degraded == []
    assert source.notes == [
        f"a.mkv: {float(rate):g} frames/s, light interpolated linearly in time between frames"
    ]


def test_the_exposure_of_a_film_is_the_closed_form(tmp_path, make_clip):
    # Frames at 0, 40 and 80 ms: 0, 1 and 0 of full light. From 20 to 60 ms: two trapezia.
    source = FilmSource(make_clip(tmp_path / "a.mkv", flat(0, 255, 0)), SHAPE, LUX, CLOCK, 3200)
    light = source.step(None, Block(0, 3200))
    seconds = 2 * 0.02 * (0.5 + 1) / 2
    exposure = light.integral(PS // 50, 3 * PS // 50)
    np.testing.assert_allclose(exposure, LUX * seconds, rtol=1e-6)


@settings(max_examples=30)
@given(data=st.data())
def test_light_does_not_depend_on_how_the_run_is_split(tmp_path_factory, make_clip, data):
    path = tmp_path_factory.getbasetemp() / "split.mkv"
    if not path.exists():
        make_clip(path, flat(0, 255, 64, 128, 30, 200), rate=Fraction(30_000, 1001))
    cycles = 6_000
    size = data.draw(st.integers(64, cycles))
    start = data.draw(st.integers(0, cycles - 1))  # goes on from a checkpoint
    whole = FilmSource(path, SHAPE, LUX, CLOCK, cycles).step(None, Block(0, cycles))
    source = FilmSource(path, SHAPE, LUX, CLOCK, cycles)
    for block in blocks(cycles, size, start):
        light = source.step(None, block)
        first, stop = CLOCK.edge(block.start), CLOCK.edge(block.stop)
        assert light.pieces[0].start <= first
        assert light.pieces[-1].stop >= stop
        for ps in (first, (first + stop) // 2, stop - 1):
            np.testing.assert_array_equal(light.at(ps), whole.at(ps))


def test_start_is_an_instant_of_the_clip(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", flat(*range(0, 250, 10)))
    whole = FilmSource(path, SHAPE, LUX, CLOCK, 1000)
    later = FilmSource(path, SHAPE, LUX, CLOCK, 1000, start=0.25)  # inside frame 6
    for ps in (0, 1, 10**9, 3 * 10**10):
        np.testing.assert_allclose(later.truth(ps), whole.truth(ps + PS // 4), atol=1e-7)
        light = later.step(None, Block(CLOCK.cycle_at(ps), 1)).at(ps)
        np.testing.assert_allclose(light, LUX * later.truth(ps), rtol=1e-5)


def test_a_start_behind_the_end_is_refused_with_the_clip_s_length(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", flat(*range(25)))
    with pytest.raises(InputError) as caught:
        FilmSource(path, SHAPE, LUX, CLOCK, 1000, start=1.5)
    said = str(caught.value)
    assert said == "scene.start must be within the 1 s of the clip, not 1.5 s; start earlier"
    with pytest.raises(InputError) as caught:
        FilmSource(path, SHAPE, LUX, CLOCK, 100, start=0.5, rate=100.0)
    assert str(caught.value) == (
        "scene.start must be within the 0.25 s of the clip at 100 frames/s, not 0.5 s; start "
        "earlier: it counts time at scene.frame_rate, where a second of the file takes 0.25 s"
    )


def test_a_frame_rate_of_the_scenario_overrides_the_clip_s_and_says_so(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", flat(0, 255, 0))
    source = FilmSource(path, SHAPE, LUX, CLOCK, 40, rate=2000.0)
    np.testing.assert_allclose(source.truth(PS // 4000), 0.5, atol=1e-7)
    np.testing.assert_allclose(source.truth(PS // 2000), 1, atol=1e-7)
    assert source.notes == [
        "a.mkv: 2000 frames/s by scene.frame_rate (the clip has 25), light interpolated linearly "
        "in time between frames"
    ]


@pytest.mark.parametrize("name", ["still.png", "still.jpg", "one.mkv"])
def test_a_still_image_is_constant_light(tmp_path, make_clip, name):
    path = tmp_path / name
    if name == "one.mkv":
        make_clip(path, flat(128))
    else:
        cv2.imwrite(str(path), flat(128)[0])
    source = FilmSource(path, SHAPE, LUX, CLOCK, 10**6, start=3.0, rate=50.0)
    light = source.step(None, Block(999_000, 1000))
    assert len(light.pieces) == 1
    assert light.pieces[0].constant
    for ps in (0, 10**12, CLOCK.edge(10**6)):
        np.testing.assert_allclose(source.truth(ps), srgb(128), atol=1e-6)
    np.testing.assert_allclose(light.at(CLOCK.edge(999_500)), LUX * srgb(128), rtol=1e-5)
    assert source.notes == [
        f"{name} is a still image; scene.start and scene.frame_rate have no effect"
    ]
    assert FilmSource(path, SHAPE, LUX, CLOCK, 10**6).notes == [f"{name} is a still image"]
    assert source.degraded == []


def test_a_start_on_the_last_frame_is_said(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", flat(0, 100, 200))
    source = FilmSource(path, SHAPE, LUX, CLOCK, 100, start=0.1)
    light = source.step(None, Block(0, 64))
    np.testing.assert_allclose(light.at(0), LUX * srgb(200), rtol=1e-5)
    assert source.degraded == [
        "the run starts at the last frame of the clip, which is held throughout; lower scene.start"
    ]


def test_a_clip_that_ends_early_holds_its_last_frame_and_says_since_when(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", flat(0, 100, 200))  # the last frame at 80 ms
    source = FilmSource(path, SHAPE, LUX, CLOCK, 8000)
    for block in blocks(8000, 64):
        light = source.step(None, block)
    for ms in (80, 100, 199):
        np.testing.assert_allclose(source.truth(ms * 10**9), srgb(200), atol=1e-6)
    np.testing.assert_allclose(light.at(CLOCK.edge(7990)), LUX * srgb(200), rtol=1e-5)
    assert source.degraded == [
        "the clip ends 80 ms into the run: its last frame is held; shorten duration or lower "
        "scene.frame_rate"
    ]
    resumed = FilmSource(path, SHAPE, LUX, CLOCK, 8000)
    again = resumed.step(None, Block(6400, 64)).at(CLOCK.edge(6400))
    np.testing.assert_array_equal(again, light.at(CLOCK.edge(7990)))
    assert resumed.degraded == source.degraded


def test_a_clip_just_long_enough_is_not_degraded(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", flat(0, 100, 200))
    source = FilmSource(path, SHAPE, LUX, CLOCK, 3200)
    for block in blocks(3200, 64):
        source.step(None, block)
    assert source.degraded == []


def test_the_real_clip_opens(shared_data):
    source = FilmSource(shared_data / "bikes.mp4", (250, 400), LUX, CLOCK, 100)
    truth = source.truth(0)
    assert 0.05 < truth.mean() < 0.8
    assert truth.std() > 0.1
    assert source.notes[0].startswith("bikes.mp4: 68% of the picture is filmed")
    assert source.notes[1].startswith("bikes.mp4: 25 frames/s")
