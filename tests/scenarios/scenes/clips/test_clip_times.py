"""When a clip's frames are shown, and how a late one is found without decoding all before it."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import numpy as np
import pytest

from cosim import PS, Block, Clock
from scenarios.scenes.clips import file_cache
from scenarios.scenes.clips.clip import Clip
from scenarios.scenes.clips.decoder import Decoder
from scenarios.scenes.clips.film import FilmSource
from scenarios.scenes.clips.timeline import Timeline

CLOCK = Clock(40_000)
SHAPE = (8, 16)
LUX = 500.0


def srgb(code: float) -> float:
    """Linear light of an 8-bit sRGB code (IEC 61966-2-1)."""
    v = code / 255
    return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4


def flat(*codes: int) -> np.ndarray:
    """Frames of one grey each."""
    return np.stack([np.full(SHAPE, code, np.uint8) for code in codes])


UNEVEN = [0, 1, 2, 6, 7, 9, 14, 15]
"""Places of frames, in fortieths of a second."""


@pytest.mark.parametrize("name", ["a.mkv", "a.nut", "a.apng"])
def test_uneven_frames_are_shown_at_their_own_times(tmp_path, make_clip, name):
    codes = [10, 250, 30, 200, 60, 120, 240, 20]
    codec = "apng" if name == "a.apng" else "ffv1"
    path = make_clip(tmp_path / name, flat(*codes), 40, codec, pts=UNEVEN)
    source = FilmSource(path, SHAPE, 1.0, CLOCK, 16_000)
    # The container's rate is a guess of FFmpeg's: 15 places of a fortieth have 8 frames.
    assert source.notes[-1].startswith(
        f"{name}: frames not evenly spaced: each has its time in the clip, light interpolated"
    )
    for n, (place, code) in enumerate(zip(UNEVEN, codes, strict=True)):
        ps = round(place / 40 * PS)
        assert source.truth(ps).mean() == pytest.approx(srgb(code), abs=1e-5)
        if n:
            between = round((UNEVEN[n - 1] + place) / 80 * PS)
            middle = (srgb(codes[n - 1]) + srgb(code)) / 2
            assert source.truth(between).mean() == pytest.approx(middle, abs=1e-5)
            block = Block(CLOCK.cycle_at(between), 1)
            assert source.step(None, block).at(CLOCK.edge(block.start)).mean() == pytest.approx(
                middle, abs=1e-5
            )


def test_frames_that_share_a_stamp_are_told_apart_by_their_order(tmp_path, make_clip):
    codes = list(range(0, 240, 8))
    clip = Clip(make_clip(tmp_path / "a.mkv", flat(*codes), 2000), SHAPE)
    for n in (20, 1, 2, 29, 3, 15):
        frame = clip.frame(n)
        assert frame is not None and frame.mean() == pytest.approx(srgb(codes[n]), abs=1e-5)


def test_times_that_the_container_does_not_tell_are_noted(tmp_path):
    """Such a clip is taken as even, and the note says so."""
    path = tmp_path / "a.ts"
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("mpeg2video", rate=25)
        stream.width, stream.height, stream.pix_fmt = 16, 16, "yuv420p"
        for place in (0, 1, 2, 9, 10, 11):
            frame = av.VideoFrame.from_ndarray(np.full((16, 16), 99, np.uint8), format="gray")
            frame.pts, frame.time_base = place, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    clip = Clip(path, SHAPE)
    clip.frame(5)
    assert clip.timeline is None
    assert clip.notes[-1] == "a.ts: frames are not evenly spaced; a uniform rate is used"


def test_a_given_rate_makes_uneven_frames_even(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", flat(*range(0, 240, 30)), 40, pts=UNEVEN)
    source = FilmSource(path, SHAPE, 1.0, CLOCK, 800, rate=100.0)
    assert source.truth(3 * PS // 100).mean() == pytest.approx(srgb(90), abs=1e-5)


def test_the_clip_s_own_mean_rate_makes_uneven_frames_even_when_it_is_given(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", flat(*range(0, 240, 30)), 40, pts=UNEVEN)
    assert FilmSource(path, SHAPE, 1.0, CLOCK, 800).truth(PS // 10).mean() < srgb(90)
    source = FilmSource(path, SHAPE, 1.0, CLOCK, 800, rate=40.0)
    assert source.truth(3 * PS // 40).mean() == pytest.approx(srgb(90), abs=1e-5)
    assert not any("not evenly" in note for note in source.notes)


class Packets:
    """A container whose packets have these stamps: (shown, decoded, whether a key frame)."""

    time_base = Fraction(1, 40)

    def __init__(self, *stamps: tuple[int | None, int | None, bool]) -> None:
        self._stamps = stamps

    def demux(self, stream: Any) -> Iterator[Any]:
        for shown, decoded, key in self._stamps:
            yield SimpleNamespace(
                pts=shown, dts=decoded, is_keyframe=key, is_discard=False, size=9
            )  # fmt: skip
        yield SimpleNamespace(pts=None, dts=None, is_keyframe=False, is_discard=False, size=0)


def timeline(*stamps: tuple[int | None, int | None, bool]) -> Timeline:
    packets = Packets(*stamps)
    return Timeline(packets, packets, Fraction(40))


def test_nothing_is_told_of_frames_around_one_without_a_stamp():
    """The frame without one may be shown before the key frame, whose number is then not known."""
    told = timeline((0, 0, True), (1, 1, False), (4, 2, True), (None, 3, False), (3, 3, False))
    assert [told.stamp(n) for n in range(4)] == [0, 1, None, None]
    assert told.number_of(4) is None and told.edge(3) == 3 * PS // 40


def test_frames_are_numbered_as_they_are_shown_from_the_first_stamp_on():
    told = timeline((-3, -5, True), (0, -4, False), (-2, -3, False), (-1, -2, False), (1, 0, True))
    assert [told.stamp(n) for n in range(6)] == [-3, -2, -1, 0, 1, None]
    assert [told.edge(n) for n in range(6)] == [n * PS // 40 for n in range(6)]
    assert told.key_before(3) == -3 and told.key_before(4) == told.key_before(9) == 1
    for n in range(1, 6):
        edge = n * PS // 40
        assert (told.number_at(edge - 1), told.number_at(edge)) == (n - 1, n)
    assert not told.uneven


def test_a_frame_that_shares_its_stamp_is_shown_a_mean_frame_later():
    told = timeline((0, 0, True), (4, 1, False), (4, 2, False), (9, 3, False))
    assert [told.edge(n) * 40 // PS for n in range(4)] == [0, 4, 5, 9]
    assert told.number_of(4) is None and told.number_of(9) == 3


@pytest.mark.parametrize("rate", [24, 30, 60, Fraction(30000, 1001), 240, 1000, 2000])
def test_stamps_rounded_to_milliseconds_are_even(tmp_path, make_clip, rate):
    path = make_clip(tmp_path / "a.mkv", flat(*range(0, 240, 8)), rate)
    source = FilmSource(path, SHAPE, 1.0, CLOCK, 4000)
    assert not any("evenly" in note for note in source.notes)
    assert source.truth(Clock(Fraction(rate).numerator, Fraction(rate).denominator).edge(3)).mean(
    ) == pytest.approx(srgb(24), abs=1e-5)  # fmt: skip


def moving(path: Path, codec: str, frames: int = 90, **options: str) -> Path:
    """A moving bar in an inter-coded clip of noise, with frames that are told by later ones."""
    noise = np.random.default_rng(7).integers(0, 60, (64, 96), np.uint8)
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, rate=30)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        stream.options = options
        for n in range(frames):
            picture = noise.copy()
            picture[:, n : n + 6] = 200 + n // 3
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="gray")))
        container.mux(stream.encode(None))
    return path


CLIPS = {
    "x264.mp4": ("libx264", {"g": "12", "bf": "3", "preset": "veryfast"}),
    "x264.mkv": ("libx264", {"g": "12", "bf": "3", "preset": "veryfast"}),
    "open.mkv": ("libx264", {"g": "12", "bf": "2", "x264-params": "open-gop=1"}),
    "mpeg4.mp4": ("mpeg4", {"g": "12", "bf": "2"}),
    "mpeg4.avi": ("mpeg4", {"g": "12", "bf": "2"}),
    "mpeg2.mpg": ("mpeg2video", {"g": "12", "bf": "2"}),
    "vp9.webm": ("libvpx-vp9", {"g": "12", "cpu-used": "8"}),
    "vp8.webm": ("libvpx", {"g": "12", "auto-alt-ref": "1", "lag-in-frames": "10"}),
}


@pytest.mark.parametrize("name", CLIPS)
def test_a_late_frame_is_the_one_that_decoding_from_the_beginning_gives(tmp_path, name):
    codec, options = CLIPS[name]
    path = moving(tmp_path / name, codec, **options)
    shape = (64, 96)
    straight = Clip(path, shape)
    truth = []
    while (frame := straight.frame(len(truth))) is not None:
        truth.append(frame)
    assert len(truth) == 90
    for order in ([70, 71, 72], [88, 89, 90], [40, 5, 80, 41, 12, 11, 13, 0, 47, 48, 49]):
        file_cache._CACHE.clear()
        clip = Clip(path, shape)
        for n in order:
            found = clip.frame(n)
            if n == 90:
                assert found is None and clip.ended and clip.count == 90
                np.testing.assert_array_equal(clip.last(), truth[89])
            else:
                np.testing.assert_array_equal(found, truth[n], err_msg=f"frame {n}")


@pytest.mark.parametrize("name", ["x264.mp4", "x264.mkv", "mpeg4.mp4"])
def test_a_late_start_decodes_from_the_key_frame_before_it(tmp_path, monkeypatch, name):
    codec, options = CLIPS[name]
    path = moving(tmp_path / name, codec, **options)
    decoded = []
    decode = Decoder._decode
    monkeypatch.setattr(Decoder, "_decode", lambda each: decoded.append(1) or decode(each))
    early = FilmSource(path, SHAPE, LUX, CLOCK, 40)
    whole = early.truth(2500 * PS // 1000)
    decoded.clear()
    file_cache._CACHE.clear()
    late = FilmSource(path, SHAPE, LUX, CLOCK, 40, start=2.5)
    np.testing.assert_array_equal(late.truth(0), whole)
    assert len(decoded) <= 2 + 12 + 2
