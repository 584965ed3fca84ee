"""Clips with motion between their frames as scenes: light, truth, blocks, notes, refusals, runs."""

from __future__ import annotations

import os
import signal
from typing import Any

import av
import cv2
import numpy as np
import pytest

from cosim import PS, Block, Clock, Interrupted
from cosim.config.amounts import percent
from cosim.light.mosaic import Mosaic
from cosim.light.survey import survey
from cosim.run.loop import run_blocks
from cosim.run.shown import SilentProgress
from scenarios.scenes.clips.clip import Clip
from scenarios.scenes.clips.film import FilmSource
from scenarios.scenes.clips.motion_film import MotionFilm
from tests.scenarios.pages import page_of

CLOCK = Clock(40_000)
SHAPE = (60, 100)
LUX = 500.0
RATE = 1000
"""Frames/s of the clips made here: 40 cycles a frame."""


def texture(seed: int) -> np.ndarray:
    rough = np.random.default_rng(seed).random((80, 160)).astype(np.float32)
    smooth = 0.5 + 4 * (cv2.GaussianBlur(rough, (0, 0), 2.0) - 0.5)
    return np.rint(255 * np.clip(smooth, 0, 1)).astype(np.uint8)


def moving(frames: int, speed: int = 3, seed: int = 1) -> np.ndarray:
    """A texture that moves to the left by `speed` columns a frame."""
    whole = texture(seed)
    return np.stack([whole[10:70, n * speed : n * speed + 100] for n in range(frames)])


@pytest.fixture(scope="module")
def path(tmp_path_factory, make_clip):
    return make_clip(tmp_path_factory.mktemp("clips") / "moving.mkv", moving(6), rate=RATE)


def film(path, cycles=200, **more) -> MotionFilm:
    return MotionFilm(path, SHAPE, LUX, CLOCK, cycles, **more)


def test_the_light_between_frames_is_the_texture_on_its_way(path):
    source, linear = film(path), FilmSource(path, SHAPE, LUX, CLOCK, 200)
    still = Clip(path, SHAPE).frame(0)
    inner = (slice(8, -8), slice(8, -16))
    for cycle in (10, 20, 30):  # 0.75, 1.5 and 2.25 columns after frame 0
        shift = 3 * cycle / 40
        there = np.float32([[1, 0, -shift], [0, 1, 0]])
        true = cv2.warpAffine(still, there, SHAPE[::-1], flags=cv2.INTER_CUBIC)[inner]
        error = source.truth(CLOCK.edge(cycle))[inner] - true
        worse = linear.truth(CLOCK.edge(cycle))[inner] - true
        assert np.sqrt(np.mean(error**2)) < 0.3 * np.sqrt(np.mean(worse**2)), cycle


def test_light_is_linear_from_plane_to_plane_and_the_truth_is_the_light(path):
    source, seen = film(path), film(path)
    light = source.step(None, Block(0, 160))
    assert len(light.pieces) == 4 * 4  # 3 columns a frame: 4 planes, one of them the frame itself
    for ps in (0, 1, PS // 4000, PS // 1000 - 1, PS // 1000, 3 * PS // 1234):
        np.testing.assert_allclose(light.at(ps) / LUX, seen.truth(ps), atol=1e-6)
    for one, two in zip(light.pieces, light.pieces[1:], strict=False):
        assert one.last is two.first  # a lens maps each plane once
    np.testing.assert_array_equal(
        light.at(PS // 1000) / np.float32(LUX), FilmSource(path, SHAPE, LUX, CLOCK, 200)
        .step(None, Block(0, 160)).at(PS // 1000) / np.float32(LUX),
    )  # fmt: skip


def test_the_light_does_not_depend_on_blocks_nor_on_where_a_run_begins(path):
    whole = film(path).step(None, Block(0, 200))
    instants = [CLOCK.middle(cycle) for cycle in range(0, 200, 7)]
    for size, begin in ((1, 0), (13, 0), (64, 0), (16, 120)):
        source = film(path)
        for start in range(begin, 200, size):
            light = source.step(None, Block(start, min(size, 200 - start)))
            for ps in instants:
                if CLOCK.edge(start) <= ps < CLOCK.edge(min(start + size, 200)):
                    np.testing.assert_array_equal(light.at(ps), whole.at(ps))


def test_the_truth_at_pixels_is_that_of_the_plane(path):
    points = [(0, 0, "corner"), (30, 50, "middle"), (59, 99, "other corner")]
    source = film(path)
    for ps in (0, PS // 2500, 3 * PS // 1100, PS):
        plane = source.truth(ps)
        expected = [plane[y, x] for y, x, _ in points]
        np.testing.assert_allclose(source.truth_at(ps, points), expected, atol=1e-5)


def test_the_survey_holds_the_light_and_says_that_it_is_an_estimate(path):
    found = survey(film(path), CLOCK, 200)
    source = film(path)
    for cycle in range(0, 200, 3):
        light = source.step(None, Block(cycle, 1)).at(CLOCK.edge(cycle))
        slack = 0.01 * LUX  # cubic interpolation overshoots
        assert (light >= found.least - slack).all() and (light <= found.most + slack).all()
    assert not found.certain.any()
    assert found.planes == pytest.approx(20 / 200)


def test_two_pairs_of_frames_and_a_few_planes_are_held(path):
    source = film(path)
    for cycle in range(0, 200, 8):
        source.step(None, Block(cycle, 8))
        assert len(source._spans) <= 2
        assert len(source._lights) <= 2
        assert len(source._parts) <= 4
        assert len(source._planes) <= 3


def test_the_last_frame_is_held_beyond_the_end(path):
    source = film(path, cycles=400)
    light = source.step(None, Block(199, 201))
    np.testing.assert_allclose(light.at(PS // 110) / LUX, source.truth(PS), rtol=1e-6)
    assert source.degraded and "its last frame is held" in source.degraded[0]


def test_a_cut_is_not_smeared(tmp_path, make_clip):
    frames = np.concatenate([moving(2), moving(2, seed=9)])
    path = make_clip(tmp_path / "cut.mkv", frames, rate=RATE)
    source, linear = film(path, 120), FilmSource(path, SHAPE, LUX, CLOCK, 120)
    for cycle in (41, 60, 79):
        ps = CLOCK.edge(cycle)
        np.testing.assert_array_equal(source.truth(ps), linear.truth(ps))
    assert 1 / 3 <= source.metrics["motion_linear"].value < 0.5
    assert source.notes[-1].endswith("pairs of frames without common motion, as across a cut: 1")


def test_a_clip_at_rest_is_the_same_with_both(tmp_path, make_clip):
    path = make_clip(tmp_path / "rest.mkv", np.repeat(moving(1), 4, axis=0), rate=RATE)
    source, linear = film(path, 100), FilmSource(path, SHAPE, LUX, CLOCK, 100)
    for start in (0, 50):
        block = Block(start, 50)
        one, two = source.step(None, block), linear.step(None, block)
        assert [p.stop for p in one.pieces] == [p.stop for p in two.pieces]
        for a, b in zip(one.pieces, two.pieces, strict=True):
            np.testing.assert_array_equal(a.first, b.first)
            np.testing.assert_array_equal(a.last, b.last)
    assert source.example() is None
    assert [metric.value for metric in source.metrics.values()] == [0.0, 0.0]
    found = survey(film(path, 100), CLOCK, 100)
    assert found.certain.all() and (found.least == found.most).all()


def test_frames_with_times_of_their_own_keep_them(tmp_path, make_clip):
    path = make_clip(tmp_path / "a.mkv", moving(4), rate=RATE, pts=[0, 10, 50, 60])
    source, linear = film(path, 2400), FilmSource(path, SHAPE, LUX, CLOCK, 2400)
    for ms in (0, 10, 50, 60):
        ps = ms * PS // 1000
        np.testing.assert_allclose(source.truth(ps), linear.truth(ps), atol=1e-6)


def test_behind_a_filter_array_the_colours_move_before_they_are_filtered(tmp_path, make_clip):
    response = np.array([[0.6, 0.1, 0.0], [0.1, 0.7, 0.2], [0.0, 0.1, 0.5]])
    mosaic, tint = Mosaic("rggb", response), np.array([1.0, 0.8, 0.6])
    frames = np.rint(moving(3)[..., None] * tint).astype(np.uint8)
    path = make_clip(tmp_path / "a.mkv", frames, rate=RATE)
    source = film(path, 80, mosaic=mosaic)
    assert source.coloured
    linear = FilmSource(path, SHAPE, LUX, CLOCK, 80, mosaic=mosaic)
    at = PS // RATE
    np.testing.assert_array_equal(source.truth(at), linear.truth(at))
    rgb = Clip(path, SHAPE, mosaic, mixed=False).frame(1)
    true = cv2.warpAffine(rgb, np.float32([[1, 0, -1.5], [0, 1, 0]]), SHAPE[::-1])
    true = mosaic.mixed(true)
    inner = (slice(8, -8), slice(8, -16))
    error = source.truth(at * 3 // 2)[inner] - true[inner]
    worse = linear.truth(at * 3 // 2)[inner] - true[inner]
    assert np.sqrt(np.mean(error**2)) < 0.4 * np.sqrt(np.mean(worse**2))


# Runs.


SETS = ("scene.interpolation=motion", "duration=3 ms", "image.at=[50]")


def test_a_run_says_for_what_share_of_the_pixels_light_is_linear(path, viform, tmp_path):
    out = tmp_path / "run"
    answer = viform("run", "film", "--set", f"scene.path={path}", "--set", "sensor.chip=spikeone",
                    *(word for text in SETS for word in ("--set", text)), "--out", out)  # fmt: skip
    assert answer.code == 0, answer.err
    source = MotionFilm(path, (250, 400), 700.0, CLOCK, 120)
    share = source.metrics["motion_linear"].value
    said = f"disagree for {percent(share)} of the pixels, which are interpolated linearly"
    assert said in answer.err
    page = page_of(out)
    assert said in page and ">Motion between frames</h2>" in page


@pytest.mark.slow
def test_resumed_or_with_one_stage_after_another_the_bits_are_the_same(
    path, film, tmp_path, monkeypatch
):
    sets = (f"scene.path={path}", *SETS, "duration=4 ms", "sensor.chip=spikeone")

    def record(folder, **more):
        result, where = film("film", tmp_path / folder, *sets, small=False, **more)
        files = sorted((where / "stream.zarr").rglob("*"))
        return result, [f.read_bytes() for f in files if f.is_file()]

    whole, bits = record("whole")

    class Stop(SilentProgress):
        def advance(self, done: int) -> None:
            if done >= 64 and not stopped:
                stopped.append(done)
                os.kill(os.getpid(), signal.SIGINT)

    stopped: list[int] = []
    with pytest.raises(Interrupted):
        record("resumed", progress=Stop())
    again, same = record("resumed", resume=True)
    assert same == bits
    assert again.metrics["motion_linear"] == whole.metrics["motion_linear"]

    def in_turn(*given: Any, **named: Any) -> dict[str, float]:
        assert named["parallel"]
        return run_blocks(*given, **{**named, "parallel": False})

    monkeypatch.setattr("cosim.run.chain.run_blocks", in_turn)
    assert record("serial")[1] == bits


def test_motion_is_refused_where_there_is_no_clip(refused, tmp_path, make_clip):
    motion = ("--set", "scene.interpolation=motion")
    assert refused("run", "film", *motion) == (
        "scene.interpolation must be linear for a scene that is no clip, not motion; leave it out, "
        "or give a clip as scene.path"
    )
    still = tmp_path / "still.png"
    cv2.imwrite(str(still), moving(1)[0])
    said = refused("run", "film", "--set", f"scene.path={still}", *motion)
    assert "scene.interpolation must be linear for a still image, not motion" in said
    assert "scene.interpolation" in refused("run", "star", *motion)
    assert "interpolation" in refused("run", "film", "--set", "scene.interpolation=cubic")


def test_a_clip_without_every_second_frame_is_filmed_3_db_closer_to_those_frames(
    shared_data, tmp_path, make_clip
):
    frames = []
    with av.open(str(shared_data / "bikes.mp4")) as container:
        for frame in container.decode(video=0):
            frames.append(frame.to_ndarray(format="rgb24"))
            if len(frames) == 75:
                break
    shape, first = (136, 320), 30  # between two cuts, at half the size
    thinned = make_clip(tmp_path / "thin.mkv", np.stack(frames[first:75:2]), rate=RATE)
    whole = Clip(shared_data / "bikes.mp4", shape)
    cycles = 22 * 40
    sources = [kind(thinned, shape, LUX, CLOCK, cycles) for kind in (MotionFilm, FilmSource)]
    gains = []
    for n in range(22):
        true = whole.frame(first + 2 * n + 1)
        ps = CLOCK.edge(40 * n + 20)
        one, two = (np.mean((source.truth(ps) - true) ** 2) for source in sources)
        gains.append(10 * np.log10(two / one))
    assert np.mean(gains) > 3
