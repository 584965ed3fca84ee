"""A run: metrics, documents, and that the same inputs give the same bits."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import re
import signal
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from skimage.metrics import structural_similarity

from cosim import InputError
from cosim.compute.opencl import Device
from cosim.config.toml import to_toml
from cosim.errors import Interrupted
from cosim.files import Recorder, ZarrStream, open_stream
from cosim.run.folder import output_folder
from cosim.run.result import Result, _clean, dumps
from cosim.spikes.viform import unpack_planes
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.machine import LatchedMachine
from scenarios.report import write_report
from sensor import EFFECTS
from sensor.latched.effects.own_draws import OWN_DRAWS
from sensor.reconstruct.fidelity import psnr, ssim, to_white


def words(folder: Path) -> np.ndarray:
    stream = open_stream(folder)
    return stream.read_words(0, -(-stream.cycles // 32))


def said(error: pytest.ExceptionInfo[InputError]) -> str:
    return str(error.value)


def picture(path: Path) -> np.ndarray:
    grey = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert grey is not None
    assert (grey.ndim, grey.dtype) == (2, np.uint8)
    return grey


# Fidelity.


def test_psnr_of_a_known_error_is_the_closed_form():
    truth = np.full((40, 50), 0.25, np.float32)
    assert psnr(truth + np.float32(0.125), truth) == pytest.approx(20 * math.log10(8))
    assert psnr(truth, truth) == math.inf


def test_ssim_of_scaled_contrast_is_the_closed_form():
    # On a plane without structure SSIM is its luminance term (Wang 2004, eq. 6, C1 = 1e-4).
    one, two = 0.25, 0.5
    planes = [np.full((40, 40), x, np.float32) for x in (one, two)]
    expected = (2 * one * two + 1e-4) / (one**2 + two**2 + 1e-4)
    assert ssim(*planes) == pytest.approx(expected, rel=1e-4)
    assert math.isnan(ssim(planes[0][:10], planes[1][:10]))


def test_a_rate_becomes_reflectance_with_white_as_1_and_nothing_beyond():
    rates = np.array([[0, 0.3, 0.6, 1.0]], np.float32)
    np.testing.assert_allclose(to_white(rates, 0.6), [[0, 0.5, 1, 1]])
    np.testing.assert_array_equal(to_white(rates, 0.0), [[0, 1, 1, 1]])


def test_metrics_follow_from_the_pictures_that_viform_image_makes(step_run, viform, tmp_path):
    metrics = step_run.result.metrics
    white = metrics["white_rate"].value
    for method in ("tfp", "tfi"):
        levels, structures, slack = [], [], []
        for cycle in (10, 30, 50, 70, 90):
            out = tmp_path / "a.png"
            answer = viform(
                "image", step_run.folder, "--at", cycle, "--method", method, "--scale", repr(white),
                "--out", out,
            )  # fmt: skip
            assert answer.code == 0
            np.testing.assert_array_equal(
                picture(out), picture(step_run.folder / f"images/{method}-{cycle:05d}.png")
            )
            image = picture(out) / 255
            truth = picture(step_run.folder / f"images/truth-{cycle:05d}.png") / 255
            rms = math.sqrt(np.mean((image - truth) ** 2))
            levels.append(-20 * math.log10(rms))
            # Either picture is rounded by at most half a step, so the RMS moves by at most one:
            # a triangle inequality.
            slack.append(-20 * math.log10(1 - 1 / 255 / rms) if rms > 1 / 255 else math.inf)
            how = {"data_range": 1, "gaussian_weights": True, "use_sample_covariance": False}
            structures.append(structural_similarity(image, truth, sigma=1.5, **how))
        assert max(slack) < 6
        assert np.mean(levels) == pytest.approx(metrics[f"{method}_psnr"].value, abs=np.mean(slack))
        # To first order the rounding adds a variance of 2 x (1/255)^2 / 12 to the windows' own.
        assert np.mean(structures) == pytest.approx(metrics[f"{method}_ssim"].value, abs=0.02)


def test_metrics_are_those_of_the_unrounded_images_against_the_closed_form_of_the_light(step_run):
    stream = open_stream(step_run.folder)
    bars = np.tile((np.arange(400) * 8 // 400 + 1) / 8, (250, 1))
    levels = []
    for cycle in (10, 30, 50, 70, 90):
        first, stop = max(cycle - 20, 0), min(cycle + 21, 100)
        planes = unpack_planes(stream.read_words(0, 4), first, stop)
        estimate = np.clip(planes.mean(axis=0) / 0.6, 0, 1)
        truth = bars * (0.1 if cycle < 50 else 0.9)
        levels.append(-10 * math.log10(np.mean((estimate - truth) ** 2)))
    assert step_run.result.metrics["tfp_psnr"].value == pytest.approx(np.mean(levels), rel=1e-5)


def test_the_truth_is_the_light_of_the_middle_of_the_cycle(step_run):
    bars = (np.arange(400) * 8 // 400 + 1) / 8
    for cycle in (10, 30, 50, 70, 90):  # the light jumps 0.4 of the way into cycle 50
        level = 0.1 if cycle < 50 else 0.9
        expected = np.rint(255 * level * bars.astype(np.float32))
        truth = picture(step_run.folder / f"images/truth-{cycle:05d}.png")
        assert np.abs(truth - expected).max() <= 1
        assert np.abs(truth - expected).mean() < 0.2


def test_the_spike_rate_is_that_of_the_light(step_run):
    stream = open_stream(step_run.folder)
    spikes = int(np.bitwise_count(words(step_run.folder)).sum())
    rate = spikes / (100 * 100_000)
    assert step_run.result.metrics["spike_rate"].value == pytest.approx(rate, rel=1e-12)
    # 50.4 cycles at 0.1 and 49.6 at 0.9 of a mean bar of 0.5625; a pixel's count is off by less
    # than 1 for its phase plus shot noise of 1/sqrt(1000) of a spike each: over 1e5 pixels a
    # standard error below 1e-5 of a spike a cycle.
    light = 0.6 * 0.5625 * (50.4 * 0.1 + 49.6 * 0.9) / 100
    assert rate == pytest.approx(light, abs=5e-5)
    assert stream.shape == (250, 400)


def test_a_pixel_s_latency_is_its_interval(step_run):
    (row,) = step_run.result.latency
    assert row.stage == "interval"
    # The brightest bar after the jump fires every 1 or 2 cycles of 25 us; no interval is longer
    # than the run.
    assert row.min_us == 25
    assert row.min_us <= row.median_us <= row.max_us <= 2500


# The document.


def test_a_stream_that_is_not_kept_outlives_a_full_disk(film, tmp_path, monkeypatch):
    def full(folder, result):
        raise OSError(28, "No space left on device")

    sets = ("step", tmp_path / "run", "scene.at=1.26 ms")
    monkeypatch.setattr("scenarios.run.write_result", full)
    with pytest.raises(InputError, match="make room"):
        film(*sets, store="none")
    assert (tmp_path / "run" / "stream.zarr").exists()
    monkeypatch.undo()
    result, folder = film(*sets, store="none", resume=True)
    assert "stream.zarr" not in result.files and not list(folder.rglob("*.zarr"))


def test_a_stream_that_is_not_kept_leaves_the_same_images(film, tmp_path, step_run):
    sets = ("scene.at=1.26 ms", "image.at=[]", "title=A step <script>alert(1)</script> & more")
    result, folder = film("step", tmp_path / "run", *sets, store="none", report=write_report)
    assert not list(folder.rglob("*.zarr"))
    assert set(result.files) == set(step_run.result.files) - {"stream.zarr"}
    assert all((folder / name).exists() for name in result.files)
    for image in (step_run.folder / "images").iterdir():
        assert (folder / "images" / image.name).read_bytes() == image.read_bytes()


def test_a_run_without_a_report_has_its_result_and_stream_alone(viform, tmp_path, step_run):
    given = step_run.folder / "scenario.toml"
    answer = viform("run", given, "--report", "none", "--out", tmp_path / "run")
    assert answer.code == 0
    assert answer.out.split()[-2:] == ["result", str(tmp_path / "run" / "result.json")]
    assert {path.name for path in (tmp_path / "run").iterdir()} == {
        "scenario.toml", "stream.zarr", "result.json",
    }  # fmt: skip
    result = json.loads((tmp_path / "run" / "result.json").read_text(encoding="utf-8"))
    assert set(result["files"]) == {"scenario.toml", "stream.zarr", "result.json"}
    page = json.loads((step_run.folder / "result.json").read_text(encoding="utf-8"))
    for document in (result, page):
        for timed in ("camera", "full_physics"):
            del document["metrics"][timed]
    assert all(result[name] == page[name] for name in ("error", "plan", "metrics", "latency"))


def test_the_document_has_the_fields_of_the_design_in_their_order(step_run):
    text = (step_run.folder / "result.json").read_text(encoding="utf-8")
    document = json.loads(text)
    assert text == dumps(step_run.result.document()) + "\n"
    assert list(document) == [
        "scenario", "outcome", "seed", "version", "device", "renderer", "simulated_s", "run_time_s",
        "error", "plan", "metrics", "latency", "throughput", "files",
    ]  # fmt: skip
    assert document["scenario"] == "step"
    assert document["outcome"] == "ok"
    assert document["seed"] == 1
    assert document["renderer"] is None
    assert document["simulated_s"] == 0.0025
    assert document["run_time_s"] > 0
    error = document["error"]
    assert list(error) == [
        "value", "kind", "ci", "tolerance", "tiles_checked", "tiles_over", "of", "law",
    ]  # fmt: skip
    assert error["of"] == "law" and list(error["law"]) == [
        "mean", "variance", "interval_tv", "correlation",
    ]  # fmt: skip
    for figure in error["law"].values():
        assert list(figure) == ["value", "ci"]
        assert figure["ci"][0] <= figure["value"] <= figure["ci"][1]
    low, high = error["ci"]
    assert 0 <= low <= error["value"] <= high <= error["tolerance"] == 1e-3
    patches, others = re.fullmatch(
        r"measured on (\d+) patches of \d+ pixels and 16 pixels in each of (\d+) other tiles; "
        "in law: with paired draws, and the distance of the bank's own added",
        error["kind"],
    ).groups()  # type: ignore[union-attr]
    assert error["tiles_checked"] == int(patches) + int(others) and error["tiles_over"] == 0
    (bank,) = document["plan"]["left_out"]
    assert document["plan"]["kept"] == list(EFFECTS)
    assert bank["effect"] == OWN_DRAWS and bank["measured"] == 0
    assert 0 < bank["bound"] < 5e-4
    assert list(document["metrics"]) == [
        "tfp_psnr", "tfp_ssim", "tfi_psnr", "tfi_ssim", "spike_rate", "white_rate", "f_number",
        "camera",
        "full_physics", "size_zstd", "size_repeat", "size_first_spike", "size_line",
        "size_statistical",
    ]  # fmt: skip
    for metric in document["metrics"].values():
        assert list(metric) == ["value", "unit"]  # with a figure there is no reason
    assert [row["stage"] for row in document["throughput"]] == ["sensor", "recorder"]
    for row in document["throughput"]:
        assert list(row) == ["stage", "value", "unit"]
        assert row["value"] > 0
    for row in document["latency"]:
        assert list(row) == ["stage", "min_us", "median_us", "max_us"]
    assert "NaN" not in text and "Infinity" not in text


def test_the_files_of_the_document_are_those_of_the_folder(step_run):
    there = {
        str(path.relative_to(step_run.folder))
        for path in step_run.folder.rglob("*")
        if path.is_file() and "stream.zarr" not in path.parts
    }
    assert set(step_run.result.files) == there | {"stream.zarr"}
    assert len(step_run.result.files) == len(set(step_run.result.files))


def test_what_is_unknown_is_null_wherever_it_stands():
    document = {"a": [math.nan, {"b": (math.inf, 1.5)}], "c": -math.inf, "d": "nan"}
    assert _clean(document) == {"a": [None, {"b": [None, 1.5]}], "c": None, "d": "nan"}
    empty = Result("x", "ok", 1, "none", 0.0, 1e-3).document()
    assert json.loads(dumps(empty))["run_time_s"] is None


# The same inputs, the same bits.


def test_a_seed_decides_the_stream(film, tmp_path):
    first = words(film("step", tmp_path / "a", "seed=7")[1])
    np.testing.assert_array_equal(first, words(film("step", tmp_path / "b", "seed=7")[1]))
    other = words(film("step", tmp_path / "c", "seed=8")[1])
    # Two phases drawn apart: nearly every pixel's word differs.
    assert (first != other).mean() > 0.5


def test_the_scenario_in_the_folder_makes_the_same_words(step_run, film, tmp_path):
    _, folder = film(str(step_run.folder / "scenario.toml"), tmp_path / "again", small=False)
    np.testing.assert_array_equal(words(folder), words(step_run.folder))
    assert load(str(folder))[1] == load(str(step_run.folder))[1]


def test_opencl_and_numba_make_the_same_words(device: Device, film, tmp_path, make_clip):
    # With a tolerance OpenCL runs the fast tier, which numba has not.
    exact = ("step", "scene.at=1.26 ms", "tolerance=0")
    result, folder = film(exact[0], tmp_path / "numba", *exact[1:], device="numba")
    other, opencl = film(exact[0], tmp_path / "opencl", *exact[1:])
    assert result.device == "numba on this processor" != other.device
    np.testing.assert_array_equal(words(folder), words(opencl))
    noise = np.random.default_rng(1).integers(0, 256, (8, 25, 40), np.uint8)
    clip = make_clip(tmp_path / "a.mkv", noise, rate=2997)
    ramps = [
        words(film("film", tmp_path / name, f"scene.path={clip}", "tolerance=0", device=choice)[1])
        for name, choice in (("ramp", None), ("ramp-numba", "NUMBA"))
    ]
    np.testing.assert_array_equal(*ramps)


def test_what_does_not_change_a_bit_does_not_change_the_words(film, tmp_path, step_run):
    # A tolerance does, once it is large enough to leave something out; the window and the instants
    # then decide what.
    _, folder = film("step", tmp_path / "run", "scene.at=1.26 ms", "title=another", "image.at=[50]")
    np.testing.assert_array_equal(words(folder), words(step_run.folder))


# Outcomes.


def test_a_clip_that_ends_early_makes_a_degraded_run_that_says_so(film, make_clip, tmp_path):
    clip = make_clip(tmp_path / "a.mkv", np.full((2, 25, 40), 200, np.uint8), rate=1000)
    runs: list[Any] = []
    result, _ = film(
        "film",
        tmp_path / "run",
        f"scene.path={clip}",
        report=lambda machine, run: runs.append(run) or [],
    )
    assert result.outcome == "degraded"
    assert runs[0].notes[-1] == (
        "the clip ends 1 ms into the run: its last frame is held; shorten duration or lower "
        "scene.frame_rate"
    )


def test_notes_that_come_up_while_the_clip_is_read_reach_the_report(film, make_clip, tmp_path):
    clip = make_clip(
        tmp_path / "a.mkv",
        np.full((8, 25, 40), 200, np.uint8),
        1000,
        pts=[0, 1, 2, 3, 4, 9, 10, 11],
    )
    runs: list[Any] = []
    film("film", tmp_path / "run", f"scene.path={clip}", "duration=6 ms",
         report=lambda machine, run: runs.append(run) or [])  # fmt: skip
    assert any("a.mkv" in note and "not evenly spaced" in note for note in runs[0].notes)


def test_darkness_gives_no_spikes_and_no_nan(film, tmp_path):
    _, folder = film("step", tmp_path / "run", "scene.at=1 ms", "scene.before=0", "scene.after=0")
    # Nothing falls on a pixel, so nothing reaches a threshold; truth and images are all black.
    assert int(np.bitwise_count(words(folder)).sum()) == 0
    document = json.loads((folder / "result.json").read_text())
    assert document["metrics"]["spike_rate"]["value"] == 0
    assert document["metrics"]["tfp_psnr"]["value"] is None
    assert document["latency"] == []


def test_an_airy_lens_blurs_the_light_that_the_chip_gets(film, tmp_path):
    sets = ("scene.at=0 ms", "sensor.lens.f_number=16", "scene.illuminance=100 klx")
    sharp = words(film("step", tmp_path / "sharp", *sets)[1])
    blurred = words(film("step", tmp_path / "airy", *sets, "sensor.lens.psf=airy")[1])
    counts = [np.bitwise_count(w).sum(axis=(0, 1)).astype(float) for w in (sharp, blurred)]
    edge = slice(195, 205)  # bars 4 and 5 meet at column 200
    steps = [np.abs(np.diff(count[edge])).max() for count in counts]
    assert steps[1] < 0.8 * steps[0]
    assert counts[1].sum() == pytest.approx(counts[0].sum(), rel=1e-3)


# Folders.


def test_folders_are_numbered_and_taken_ones_are_passed_over(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert output_folder("film", None, False) == Path("runs/film-1")
    Path("runs/film-1").mkdir(parents=True)
    Path("runs/film-3").mkdir()
    assert output_folder("film", None, False) == Path("runs/film-2")


def test_a_folder_in_use_is_refused_and_an_empty_one_taken(tmp_path):
    assert output_folder("film", tmp_path, False) == tmp_path
    (tmp_path / "mine").touch()
    with pytest.raises(InputError) as caught:
        output_folder("film", tmp_path, False)
    assert said(caught) == (
        f"--out must be a new or empty folder, not {tmp_path}; choose another, or add --resume"
    )
    assert output_folder("film", tmp_path, True) == tmp_path
    with pytest.raises(InputError, match="must be a folder, not the file"):
        output_folder("film", tmp_path / "mine", False)
    with pytest.raises(InputError, match="must be given with --out, not alone"):
        output_folder("film", None, True)


def test_a_full_disk_is_said_and_leaves_nothing_that_looks_whole(film, tmp_path, monkeypatch):
    step = Recorder.step

    def fill(self: Recorder, given: Any, block: Any) -> Any:
        if block.start:
            raise OSError(errno.ENOSPC, "No space left on device")
        return step(self, given, block)

    monkeypatch.setattr(Recorder, "step", fill)
    with pytest.raises(InputError) as caught:
        film("step", tmp_path / "run")
    assert said(caught).startswith(
        f"--out must be where there is room for the stream, not {tmp_path / 'run'} (No space left "
        "on device); make room, then go on with"
    )
    assert not (tmp_path / "run" / "result.json").exists()
    with pytest.raises(InputError, match="interrupted"):
        ZarrStream(tmp_path / "run" / "stream.zarr")


def test_an_interrupted_check_keeps_the_recording(film, tmp_path, monkeypatch):
    shortfall = LatchedMachine.shortfall

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(LatchedMachine, "shortfall", interrupted)
    folder = tmp_path / "run"
    with pytest.raises(Interrupted, match="--resume"):
        film("step", folder, "scene.at=1.26 ms")
    monkeypatch.setattr(LatchedMachine, "shortfall", shortfall)
    monkeypatch.setattr(Recorder, "step", interrupted)  # all of it is there
    result, _ = film("step", folder, "scene.at=1.26 ms", resume=True)
    assert result.outcome == "ok"


def test_an_interrupt_that_a_library_loses_ends_the_run(film, tmp_path):
    """As an exception does that is raised while C code calls back, such as a finaliser."""

    def lose(machine: Any, run: Any) -> list[str]:
        with contextlib.suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        return []

    folder = tmp_path / "run"
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(Interrupted, match="before the images and the report; go on with"):
        film("step", folder, report=lose)
    assert signal.getsignal(signal.SIGINT) is before
    assert not (folder / "result.json").exists() and (folder / "checkpoint.npz").exists()
    film("step", folder, resume=True)
    assert (folder / "result.json").is_file() and not (folder / "checkpoint.npz").exists()


def test_a_disk_that_is_full_by_the_report_is_said(film, tmp_path, monkeypatch):
    def fill(machine: Any, run: Any) -> list[str]:
        raise OSError(errno.ENOSPC, "No space left on device")

    def none_left(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("cosim.files.atomic.os.fsync", none_left)
    folder = tmp_path / "run"
    with pytest.raises(InputError) as caught:
        film("step", folder, report=fill)
    assert said(caught) == (
        f"--out must be where there is room for the run, not {folder} (No space left on device); "
        f"make room, then go on with the same command and --out {folder} --resume"
    )
    assert not (folder / "result.json").exists()
    assert list(folder.glob("checkpoint.*")) == []
    monkeypatch.undo()
    film("step", folder, resume=True)
    assert (folder / "result.json").is_file()


def test_the_resolved_scenario_lies_in_the_folder(step_run):
    text = (step_run.folder / "scenario.toml").read_text(encoding="utf-8")
    assert text == to_toml(load(str(step_run.folder))[1])
    assert 'chip = "spikeone"' in text
    assert 'at = "0.00126 s"' in text
