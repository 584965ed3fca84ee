"""`viform image` and `viform convert`: a public recording against its ground truth, the pixel
formula, every wrong option, and conversion without loss."""

from __future__ import annotations

import itertools
import json
import math
import shutil
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Clock, InputError, Viform
from cosim.files import open_stream, write_stream
from cosim.files.npz import write_npz
from cosim.report.png import for_display, to_linear_bytes
from cosim.spikes.viform import unpack_planes
from scenarios.cli.output import size_option
from sensor import tfp


def picture(path: Path) -> np.ndarray:
    grey = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert grey is not None
    assert (grey.ndim, grey.dtype) == (2, np.uint8)
    return grey


def planes_of(path: Path) -> np.ndarray:
    stream = open_stream(path)
    words = stream.read_words(0, -(-stream.cycles // 32))
    return unpack_planes(words, 0, stream.cycles)


@pytest.fixture(scope="module")
def spikes() -> np.ndarray:
    """61 cycles of 8 x 16 pixels, rates from 0 to 1 across."""
    chance = np.linspace(0, 1, 16)
    return np.random.default_rng(1).random((61, 8, 16)) < chance


@pytest.fixture(scope="module")
def recording(spikes, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("stream") / "a.npz"
    write_npz(Viform.from_planes(spikes, Clock(20_000)), path)
    return path


# The public recording.


@pytest.mark.parametrize(("method", "least"), [("tfp", 31.5), ("tfi", 21.5)])
def test_the_recording_shows_its_ground_truth(shared_data, viform, tmp_path, method, least):
    out = tmp_path / "a.png"
    answer = viform(
        "image", shared_data / "reds_200_part1.dat", "--at", 150, "--method", method,
        "--window", 41, "--scale", 0.6, "--out", out,
    )  # fmt: skip
    assert answer == (0, "", "")
    truth = picture(shared_data / "reds_200_part1_gt.png")
    mse = np.mean((picture(out).astype(float) - truth) ** 2)
    assert 10 * math.log10(255**2 / mse) >= least


def test_the_recording_comes_back_to_the_byte_through_every_format(shared_data, viform, tmp_path):
    source = shared_data / "reds_200_part1.dat"
    for middle in ("a.npz", "a.zarr", "a.dat"):
        assert viform("convert", source, tmp_path / middle).code == 0
        back = tmp_path / f"back-{middle}.dat"
        assert viform("convert", tmp_path / middle, back).code == 0
        assert back.read_bytes() == source.read_bytes()


# The pixel formula.


@pytest.mark.parametrize(("at", "window"), [(30, 41), (30, 1), (0, 41), (60, 5), (30, 61)])
@pytest.mark.parametrize("scale", [1.0, 0.6, 0.37])
def test_a_tfp_pixel_is_the_mean_of_its_window_over_scale(
    viform, recording, spikes, tmp_path, at, window, scale
):
    out = tmp_path / "a.png"
    viform("image", recording, "--at", at, "--window", window, "--scale", scale, "--out", out)
    part = spikes[max(at - window // 2, 0) : at + window // 2 + 1]
    exact = 255 * np.clip(part.mean(axis=0) / scale, 0, 1)
    assert np.abs(picture(out) - exact).max() <= 0.5 + 1e-4  # float32 of the mean


def interval(column: np.ndarray, at: int) -> int:
    """Cycles of the interval that holds `at`, or the nearest whole one; 0 where there is none."""
    fired = np.flatnonzero(column)
    if fired.size < 2:
        return 0
    end = min(max(int(np.searchsorted(fired, at)), 1), fired.size - 1)
    return int(fired[end] - fired[end - 1])


@pytest.mark.parametrize("at", [0, 7, 30, 60])
def test_tfi_and_tau_pixels_follow_from_the_interval_that_holds_the_instant(
    viform, recording, spikes, tmp_path, at
):
    tau = np.array([[interval(spikes[:, r, c], at) for c in range(16)] for r in range(8)])
    out = tmp_path / "a.png"
    viform("image", recording, "--at", at, "--method", "tfi", "--scale", 0.5, "--out", out)
    rate = np.divide(1, tau, out=np.zeros(tau.shape), where=tau > 0)
    assert np.abs(picture(out) - 255 * np.clip(rate / 0.5, 0, 1)).max() <= 0.5 + 1e-4
    viform("image", recording, "--at", at, "--method", "tau", "--out", out)
    np.testing.assert_array_equal(picture(out), np.where(tau > 0, 255 - tau, 0))


@given(st.floats(1e-300, 1e300), st.integers(0, 41))
def test_any_scale_gives_a_grey_and_no_warning(scale, count):
    rate = np.full((1, 1), count / 41, np.float32)
    expected = round(255 * min(float(rate[0, 0]) / scale, 1))
    assert abs(int(to_linear_bytes(rate, scale)[0, 0]) - expected) <= 1


def test_image_says_with_json_what_it_did(viform, recording, tmp_path):
    out = tmp_path / "a.png"
    answer = viform("image", recording, "--at", 30, "--method", "tau", "--out", out, "--json")
    assert json.loads(answer.out) == {
        "stream": str(recording), "out": str(out), "method": "tau", "at": 30, "window": None,
        "window_cycles": None, "preceding": False, "longest": 255, "ties": "before",
        "sub_threshold_pixels": None, "dark_pixels": None, "plain_pixels": None,
        "one_sided_pixels": None, "scale": None, "cycles": 61, "height": 8, "width": 16,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("options", "used"),
    [((30,), 41), ((55,), 26), ((5, "--preceding"), 6), ((60, "--preceding"), 41)],
)
def test_a_window_is_cut_at_the_ends_and_json_says_to_how_many_cycles(
    viform, recording, spikes, tmp_path, options, used
):
    out, at = tmp_path / "a.png", options[0]
    told = json.loads(viform("image", recording, "--at", *options, "--out", out, "--json").out)
    assert (told["window"], told["window_cycles"]) == (41, used)
    assert told["preceding"] is ("--preceding" in options)
    stop = at + 1 if told["preceding"] else min(at + 21, 61)
    rate = spikes[stop - used : stop].mean(axis=0)
    assert np.abs(picture(out) - 255 * rate).max() <= 0.5 + 1e-4


@pytest.mark.parametrize("window", [None, 9])
@pytest.mark.parametrize("preceding", [False, True])
def test_tau_of_a_window_is_black_where_it_is_noise(
    viform, recording, spikes, tmp_path, window, preceding
):
    first, stop = 0, 31 if preceding else 61
    if window is not None:
        first, stop = (22, 31) if preceding else (26, 35)
    words = ["--method", "tau", "--dark-limit", 3, *(["--preceding"] if preceding else [])]
    words += [] if window is None else ["--window", window]
    out = tmp_path / "a.npy"
    told = json.loads(
        viform("reconstruct", recording, "--at", 30, *words, "--out", out, "--json").out
    )
    found = np.load(out)
    assert told["window_cycles"] == window
    for place in np.ndindex(found.shape):
        column = spikes[(slice(None), *place)]
        fired = np.flatnonzero(column)
        last = fired[fired < 30].max(initial=-1)
        end = fired[fired >= 30].min(initial=61)
        expected = interval(column[first:stop], 30 - first)
        assert found[place] == (0 if end - last >= 3 else expected)
    assert 0 < told["dark_pixels"] < found.size


@pytest.mark.parametrize("method", ["tfp", "tfi", "tfstp"])
def test_a_npy_has_the_rate_that_the_picture_shows(viform, recording, tmp_path, method):
    words = ["reconstruct", recording, "--at", 30, "--method", method, "--scale", 0.6, "--out"]
    for ending in ("png", "npy"):
        assert viform(*words, tmp_path / f"a.{ending}") == (0, "", "")
    rate = np.load(tmp_path / "a.npy")
    assert rate.dtype == np.float32
    np.testing.assert_array_equal(picture(tmp_path / "a.png"), to_linear_bytes(rate, 0.6))


def test_json_has_the_longest_interval_that_became_black(viform, recording, spikes, tmp_path):
    tau = max(interval(spikes[:, r, c], 30) for c in range(16) for r in range(8))
    out = ["--out", tmp_path / "a.png", "--json"]
    answer = viform("image", recording, "--at", 30, "--method", "tau", "--longest", "auto", *out)
    assert json.loads(answer.out)["longest"] == tau


def test_a_dat_is_read_with_the_size_that_is_given(viform, recording, spikes, tmp_path):
    path = tmp_path / "a.dat"
    assert viform("convert", recording, path).code == 0
    packed = np.packbits(spikes[:, ::-1].reshape(61, -1), axis=1, bitorder="little")
    assert path.read_bytes() == packed.tobytes()
    out = tmp_path / "a.png"
    assert viform("image", path, "--at", 9, "--window", 1, "--size", "16x8", "--out", out).code == 0
    np.testing.assert_array_equal(picture(out), 255 * spikes[9])


# Wrong options.


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--at", 61], "--at must be a cycle from 0 to 60, not 61; try --at 30"),
        (["--at", -1], "--at must be a cycle from 0 to 60, not -1; try --at 30"),
        (["--at", 5, "--window", 40], "--window must be odd and at least 1, not 40; try 41"),
        (["--at", 5, "--window", 0], "--window must be odd and at least 1, not 0; try 1"),
        (["--at", 5, "--window", -3], "--window must be odd and at least 1, not -3; try 1"),
        (["--at", 5, "--scale", 0],
         "--scale must be a number above 0, not 0; write the white_rate of the run"),
        (["--at", 5, "--scale", "nan"],
         "--scale must be a number above 0, not nan; write the white_rate of the run"),
        (["--at", 5, "--scale", "-0.6"],
         "--scale must be a number above 0, not -0.6; write the white_rate of the run"),
        (["--at", 5, "--method", "mean"],
         "--method must be one of tfp, tfi, tfstp, motion-tfp, tau, not 'mean'; choose one"),
        (["--at", 5, "--method", "motion-tfp", "--preceding"],
         "--preceding must be given with --method tfp, tfi, tfstp, not with motion-tfp; leave it "
         "out"),
        (["--at", 5, "--method", "motion-tfp"],
         "the stream must be at least 12 pixels high and wide for motion-tfp, not 16x8; use tfp"),
        (["--at", 5, "--method", "tfi", "--window", 40],
         "--window must be odd and at least 1, not 40; try 41"),
        (["--at", 5, "--method", "tfstp", "--window", 0],
         "--window must be at least 1, not 0; try 161"),
        (["--at", 5, "--dark-limit", 0],
         "--dark-limit must be a number above 0, not 0; leave it out for that of the run"),
        (["--at", 5, "--longest", "9"],
         "--longest must be given with --method tau, not with tfp; leave it out"),
        (["--at", 5, "--ties", "after"],
         "--ties must be given with --method tfi or tau, not with tfp; leave it out"),
        (["--at", 5, "--method", "tfi", "--ties", "both"],
         "--ties must be one of before, after, not 'both'; choose one"),
        (["--at", 5, "--size", "16"],
         "--size must be WIDTHxHEIGHT such as 400x250, not '16'; write it in this form"),
        (["--at", 5, "--size", "8x16"], "--size must be 16x8 for {stream}, not 8x16; leave it out"),
    ],
)  # fmt: skip
def test_a_wrong_option_of_image_is_one_line_and_writes_nothing(
    refused, recording, tmp_path, options, expected
):
    out = tmp_path / "a.png"
    line = refused("image", recording, *options, "--out", out)
    assert line == expected.format(stream=recording)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("out", "expected"),
    [
        ("a.jpg", "--out must be a name ending in .png or .npy, not a.jpg; try a.png"),
        ("a", "--out must be a name ending in .png or .npy, not a; try a.png"),
        ("no/a.png", "--out must be in a folder that exists, not no/a.png; create the folder"),
    ],
)
def test_a_place_where_no_image_can_be_is_refused(
    refused, recording, tmp_path, monkeypatch, out, expected
):
    monkeypatch.chdir(tmp_path)
    assert refused("image", recording, "--at", 5, "--out", out) == expected
    assert list(tmp_path.iterdir()) == []


def test_a_recording_cut_off_or_of_another_size_is_refused(refused, tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(bytes(3 * 12_500 - 1))
    out = tmp_path / "a.png"
    mend = "give its true size (--size, or sensor.width and sensor.height), or take a whole file"
    assert refused("image", path, "--at", 0, "--out", out) == (
        f"{path} must be whole frames of 12500 bytes (400x250), not 37499 bytes, which is 2 frames "
        f"and 12499 bytes over; {mend}"
    )
    path.write_bytes(bytes(3 * 12_500))
    assert refused("image", path, "--at", 0, "--size", "1000x1000", "--out", out).endswith(mend)
    assert refused("convert", path, tmp_path / "a.npz", "--size", "1000x1000").endswith(mend)
    assert "a product that is a multiple of 8" in refused(
        "image", path, "--at", 0, "--size", "3x3", "--out", out
    )
    path.write_bytes(b"")
    assert refused("image", path, "--at", 0, "--out", out).endswith(mend)
    assert [p.name for p in tmp_path.iterdir()] == ["a.dat"]


@pytest.mark.parametrize("name", ["no.dat", "text.txt", "folder", "random.npz", "random.zarr"])
def test_what_is_no_stream_is_refused(refused, tmp_path, name):
    path = tmp_path / name
    if name == "folder":
        path.mkdir()
    elif name != "no.dat":
        path.write_bytes(np.random.default_rng(1).bytes(1000))
    before = sorted(tmp_path.iterdir())
    for command in (
        ("image", path, "--at", 0, "--out", tmp_path / "a.png"),
        ("convert", path, tmp_path / "b.npz"),
    ):
        assert str(path) in refused(*command)
    assert sorted(tmp_path.iterdir()) == before


@given(st.text(max_size=12))
def test_any_size_is_two_numbers_or_one_line(text):
    try:
        size = size_option(text)
    except InputError as exc:
        assert "\n" not in str(exc)
        return
    assert size is not None and len(size) == 2 and min(size) > 0


# Conversion.


@pytest.mark.parametrize(
    ("one", "two"), list(itertools.product(["npz", "zarr", "dat"], repeat=2)), ids="-".join
)
def test_conversion_between_any_two_formats_loses_nothing(viform, spikes, tmp_path, one, two):
    clock = Clock(40_000) if "dat" in (one, two) else Clock(30_000_000, 1001)
    source, out = tmp_path / f"a.{one}", tmp_path / f"b.{two}"
    write_stream(Viform.from_planes(spikes, clock), source)
    size = ("--size", "16x8") if one == "dat" else ()
    code, text, _ = viform("convert", source, out, *size, "--json")
    assert code == 0
    assert json.loads(text) == {
        "in": str(source), "out": str(out), "cycles": 61, "height": 8, "width": 16,
        "clock_hz": clock.hz,
    }  # fmt: skip
    again = open_stream(out, (16, 8))
    assert (again.cycles, again.shape, again.clock) == (61, (8, 16), clock)
    np.testing.assert_array_equal(unpack_planes(again.read_words(0, 2), 0, 61), spikes)


def test_a_run_s_folder_converts_as_its_stream(viform, step_run, tmp_path):
    assert viform("convert", step_run.folder, tmp_path / "a.dat").code == 0
    np.testing.assert_array_equal(planes_of(tmp_path / "a.dat"), planes_of(step_run.folder))


@pytest.mark.parametrize("ending", ["mp4", "gif", "webm", "mkv", "mov", "avi"])
def test_a_clip_opens_again_and_looks_like_the_tfp(viform, step_run, tmp_path, ending):
    out = tmp_path / f"a.{ending}"
    assert viform(
        "convert", step_run.folder, out, "--every", 30, "--window", 21, "--scale", 0.6,
        "--rate", 12.5,
    ).code == 0  # fmt: skip
    with av.open(str(out)) as container:
        frames = [frame.to_ndarray(format="gray") for frame in container.decode(video=0)]
        rate = container.streams.video[0].average_rate
    assert len(frames) == 4  # cycles 0, 30, 60 and 90
    assert rate == pytest.approx(12.5, rel=0.05)
    stream = open_stream(step_run.folder)
    for frame, cycle in zip(frames, range(0, 100, 30), strict=True):
        expected = for_display(tfp(stream, cycle, 21) / np.float32(0.6)).astype(float)
        assert frame.shape == (250, 400)
        # Bars of 50 columns: their means survive compression, dithering and GIF's 8 greys.
        got, wanted = (x.reshape(250, 8, 50).mean(axis=(0, 2)) for x in (frame, expected))
        assert np.abs(got - wanted).max() < (20 if ending == "gif" else 4)


def test_a_clip_of_odd_size_loses_its_last_line(viform, tmp_path):
    source = tmp_path / "a.npz"
    write_npz(Viform.from_planes(np.ones((41, 25, 33), bool), Clock(40_000)), source)
    assert viform("convert", source, tmp_path / "a.mp4").code == 0
    with av.open(str(tmp_path / "a.mp4")) as container:
        frames = [frame.to_ndarray(format="gray") for frame in container.decode(video=0)]
    assert len(frames) == 3
    assert frames[0].shape == (24, 32)
    assert frames[1].min() > 250


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--every", 0], "--every must be at least 1, not 0; leave it out for the default"),
        (["--rate", 0], "--rate must be 0.1 to 1000, not 0; leave it out for the default"),
        (["--rate", "nan"], "--rate must be 0.1 to 1000, not nan; leave it out for the default"),
        (["--rate", 1e9], "--rate must be 0.1 to 1000, not 1e+09; leave it out for the default"),
        (["--scale", 0], "--scale must be 1e-30 to 1e+30, not 0; leave it out for the default"),
        (["--window", 4], "--window must be odd and at least 1, not 4; try 5"),
    ],
)
def test_a_wrong_option_of_a_clip_is_one_line_and_writes_nothing(
    refused, recording, tmp_path, options, expected
):
    assert refused("convert", recording, tmp_path / "a.mp4", *options) == expected
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("flag", ["--window", "--every", "--scale", "--rate"])
@pytest.mark.parametrize("name", ["b.npz", "b.fsc", "b.dat"])
def test_an_option_of_a_clip_is_refused_without_one(refused, recording, tmp_path, flag, name):
    out = tmp_path / name
    assert refused("convert", recording, out, flag, 3) == (
        f"{flag} must be given with a clip to write, not {out}; leave {flag} out"
    )
    assert not out.exists()


@pytest.mark.parametrize("name", ["b.mp4", "b.zarr", "b.npz", "b.fsc", "b.events.npz"])
def test_an_interrupted_conversion_is_one_line_and_leaves_nothing(
    viform, recording, tmp_path, monkeypatch, name
):
    def stop(*words: object) -> None:  # all is written, and has no name yet
        raise KeyboardInterrupt

    monkeypatch.setattr("cosim.files.atomic.put", stop)
    assert viform("convert", recording, tmp_path / name) == (130, "", "viform: interrupted\n")
    assert list(tmp_path.iterdir()) == []


def test_a_clip_needs_two_by_two_pixels(refused, tmp_path):
    source = tmp_path / "a.npz"
    write_npz(Viform.from_planes(np.ones((41, 1, 33), bool), Clock(40_000)), source)
    assert refused("convert", source, tmp_path / "a.mp4") == (
        "the stream must be at least 2x2 pixels for a clip, not 33x1; use viform image"
    )


def test_convert_refuses_what_it_cannot_do(refused, recording, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(recording, "a.npz")
    assert refused("convert", "a.npz", "a.xyz") == (
        "OUT must be a name ending in .dat, .raw, .npz, .zarr, .events.npz, .fsc, .vfl, or of a "
        "clip (.mp4, .mkv, .mov, .avi, .webm, .gif), not a.xyz; give it one of these"
    )
    assert refused("convert", "a.npz", "no/a.dat").endswith("not in no; mkdir -p no")
    assert refused("convert", "a.npz", "./a.npz") == (
        "OUT must be another file than IN, not a.npz; choose another name"
    )
    assert refused("convert", "a.mp4", "b.npz") == (
        "IN must be a stream (.dat, .raw, .npz, .zarr, .events.npz, .fsc, .vfl), not the clip "
        "a.mp4; "
        "film it: viform run film --set scene.path=a.mp4"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_converting_over_a_file_replaces_it_whole(viform, recording, spikes, tmp_path):
    out = tmp_path / "b.zarr"
    write_stream(Viform.from_planes(~spikes[:9], Clock(1)), out)
    assert viform("convert", recording, out).code == 0
    np.testing.assert_array_equal(planes_of(out), spikes)
    assert [path.name for path in tmp_path.iterdir()] == ["b.zarr"]
