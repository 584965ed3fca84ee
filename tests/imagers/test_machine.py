"""Runs of imagers, by a small linear one: frames on disk, resuming, the plan and its check."""

import json
import shutil

import numpy as np
import pytest
import zarr

from cosim import InputError, Interrupted
from cosim.config.toml import to_toml
from cosim.plan.planner import make_plan
from cosim.run.machine import Options
from imagers.catalogue import IMAGERS
from imagers.report.figures import read_vcd
from imagers.run.check import paired_error
from imagers.run.tape import Tape, Taped
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.source.imager import assemble_imager_study, plan_imager
from scenarios.run import run_scenario
from sensor.frame_pixels import Exposed
from tests.imagers.linear_imager import (
    ELECTRONS,
    READ,
    SLOPE,
    LinearKind,
    LinearModel,
)

REPEATS = 32


class Silent:
    def start(self, what, total): ...
    def advance(self, done): ...
    def note(self, text): ...


def scenario(**keys):
    data = {
        "title": "linear", "duration": "100 ms", "tolerance": 1e-2,
        "scene": {"kind": "target", "chart": "steps", "illuminance": "100 lux"},
        "imager": {"kind": "linear"},
    }  # fmt: skip
    scene = keys.pop("scene", {})
    return validate(data | keys | {"scene": data["scene"] | scene})


@pytest.fixture(autouse=True)
def linear(monkeypatch):
    """The linear imager stands in the catalogue."""
    kind = LinearKind()
    monkeypatch.setitem(IMAGERS, "linear", kind)
    return kind


def run(folder, model, given=None, **keys):
    IMAGERS["linear"].next = model
    done = run_scenario(
        "linear", given or scenario(), folder, options=Options(**keys), progress=Silent(),
        began=0.0, report=lambda machine, run: [],
    )  # fmt: skip
    return done.result, done.folder


def study(**keys):
    return assemble_imager_study("linear", scenario(**keys), None)


def test_frames_are_on_disk_with_their_times(tmp_path):
    _, folder = run(tmp_path / "a", LinearModel())
    document = json.loads((folder / "result.json").read_text())
    assert document["outcome"] == "ok" and document["metrics"]["frames"]["value"] == 10
    assert document["metrics"]["frame_rate"]["value"] == pytest.approx(100)
    stored = zarr.open_group(folder / "frames.zarr", mode="r")
    assert stored["values"].shape == (10, 24, 32)
    assert (stored["end"][3] - stored["begin"][3] == LinearModel().exposure).all()
    # Grey steps of .9 x 100 lux for 2.5 ms, offset 20.
    white = stored["values"][:, 12, 5:7].mean()
    assert white == pytest.approx(20 + 90 * 2.5e-3 * ELECTRONS, rel=0.04)
    assert (folder / "images/frame-00009.png").is_file()
    assert not (folder / "checkpoint.tape").exists()


@pytest.mark.parametrize("broken", [1, 7])
def test_an_interrupted_run_goes_on_to_the_same_frames(tmp_path, broken):
    """The controller halves its exposure on the way, so its state must come back as well."""
    bright = scenario(scene={"illuminance": "2000 lux"})
    run(tmp_path / "whole", LinearModel(), bright)
    with pytest.raises(Interrupted, match=f"after {broken} of 10 frames"):
        run(tmp_path / "cut", LinearModel(broken=broken), bright)
    model = LinearModel()
    run(tmp_path / "cut", model, bright, resume=True)
    both = [zarr.open_group(tmp_path / n / "frames.zarr", mode="r") for n in ("whole", "cut")]
    assert both[0].attrs["state"] == both[1].attrs["state"]
    exposures = both[0].attrs["state"]["exposure"]
    assert exposures[0] > exposures[-1]
    np.testing.assert_array_equal(both[0]["values"][:], both[1]["values"][:])


def test_what_is_on_the_tape_is_not_computed_again(tmp_path):
    everything = scenario(tolerance=0.0)
    with pytest.raises(Interrupted):
        run(tmp_path / "cut", LinearModel(broken=8), everything)
    model = LinearModel()
    run(tmp_path / "cut", model, everything, resume=True)
    assert model.made[-1].pixels.calls == 2  # frames 8 and 9


def test_a_tape_cut_anywhere_or_of_another_run_is_met(tmp_path):
    with pytest.raises(Interrupted):
        run(tmp_path / "cut", LinearModel(broken=5))
    tape = tmp_path / "cut" / "checkpoint.tape"
    whole = tape.read_bytes()
    with pytest.raises(InputError, match="the checkpoint must be one of this same scenario"):
        run(tmp_path / "cut", LinearModel(), scenario(seed=9), resume=True)
    run(tmp_path / "whole", LinearModel())
    expected = zarr.open_group(tmp_path / "whole" / "frames.zarr", mode="r")["values"][:]
    (tmp_path / "cut").rename(tmp_path / "interrupted")
    # A killed run may have written no more than a part of the head.
    for kept in (whole[:-700], whole[:53], whole[:10], b""):
        shutil.rmtree(tmp_path / "cut", ignore_errors=True)
        shutil.copytree(tmp_path / "interrupted", tmp_path / "cut")
        tape.write_bytes(kept)
        run(tmp_path / "cut", LinearModel(), resume=True)
        values = zarr.open_group(tmp_path / "cut" / "frames.zarr", mode="r")["values"][:]
        np.testing.assert_array_equal(values, expected)


def test_a_tape_gives_back_windows_and_what_a_comparator_said(tmp_path):
    """Values of fewer rows than were exposed, and saturation beside values of 8 bits."""
    rows = Exposed(np.zeros((6, 5)), np.ones(6), np.zeros(6), 2, 7)

    class Windowed:
        calls = 0

        def convert(self, rows, seed, kept):
            self.calls += 1
            return np.arange(15, dtype=np.uint16).reshape(3, 5)

        def digitise(self, rows, seed, kept):
            self.calls += 1
            return np.full((6, 5), 255, np.uint16), np.eye(6, 5, dtype=bool)

    seen = []
    for resume in (False, True):
        tape, pixels = Tape(tmp_path / "tape", "a run", resume), Windowed()
        taped = Taped(pixels, tape, lambda *given: None)
        seen.append((taped.convert(rows, 1, frozenset()), *taped.digitise(rows, 1, frozenset())))
        tape.close()
        assert pixels.calls == (0 if resume else 2)
    for one, two in zip(*seen, strict=True):
        np.testing.assert_array_equal(one, two)
    assert seen[0][1].max() == 255 and seen[1][2].sum() == 5


def test_the_plan_leaves_out_what_is_small_and_the_check_finds_its_size(tmp_path):
    result, _ = run(tmp_path / "a", LinearModel())
    assert [row["effect"] for row in result.left_out] == ["leak"]
    assert result.error.value < 5e-3 and result.error.ci[1] <= 1e-2  # patches of 256 pixels
    document = study(tolerance=0.1).forecast(Silent())
    assert {"leak", "PRNU"} == {row["effect"] for row in document["left_out"]}
    assert study(tolerance=0).forecast(Silent())["left_out"] == []


def test_a_broken_promise_is_put_back(tmp_path):
    """PRNU whose bound is a lie: the check sees it, and the run is done again with it."""
    model = LinearModel()
    true = model.make

    def lying():
        imager = true()
        effect = imager.pixels.effects["PRNU"]
        bound = imager.pixels.effects["leak"].bound
        imager.pixels.effects["PRNU"] = type(effect)(
            effect.name, "", effect.stream, bound, effect.cost
        )
        return imager

    model.make = lying
    result, _ = run(tmp_path / "a", model)
    assert "PRNU" in result.kept and result.outcome == "ok"
    assert result.error.ci[1] <= 1e-2


@pytest.mark.parametrize("size", [0.0, 0.01, 0.05])
def test_the_paired_measure_finds_shift_and_noise(size):
    """A pattern of this relative size, and noise of twice it, are left out."""
    rng = np.random.default_rng(5)
    base = rng.normal(400, 10, (REPEATS, 4096))
    planned = np.broadcast_to(base, base.shape)
    full = planned + size * 400 * rng.normal(size=4096)
    found = paired_error(planned, full, 1)
    assert found.low <= size <= found.high and found.high - found.low < 0.1 * size + 1e-9
    noisy = planned + rng.normal(0, 10 * max(size, 1e-9), base.shape)
    want = 1 - 1 / np.sqrt(1 + size**2)
    seen = paired_error(planned, noisy, 1)
    assert seen.value == pytest.approx(want, abs=6 * size / np.sqrt(REPEATS * 4096) + 1e-9)


def test_accuracy_has_a_row_for_each_tolerance(tmp_path):
    document = study().ladder(Silent())
    rows = {r["tolerance"]: r for r in document["rows"] if r["tier"] == "exact"}
    assert rows[0.0]["error"] == 0 and rows[0.0]["left_out"] == []
    assert rows[0.1]["left_out"] == ["PRNU", "leak"]
    # The worst patch's RMS over 256 pixels; the offset is a part of the signal that has no pattern.
    assert SLOPE * 0.4 < rows[0.1]["error"] < SLOPE * (1 + 4.5 / np.sqrt(2 * 256))
    for row in rows.values():
        assert row["ci"][0] <= row["tolerance"]  # small patches know it no better
    assert document["reference"]["ns_per_pixel_cycle"] > 0


def test_a_model_in_two_settings_keeps_what_either_needs():
    ready = plan_imager("linear", scenario(tolerance=0.1))
    assert "read noise" in ready.kept
    effects = list(ready.pixels.effects.values())
    bright = ready.pixels.summary((50.0, 50.0), (1.0, 1.0), 10)  # 1e5 electrons
    assert READ**2 / (2 * 1e5) < 1e-3
    assert "read noise" not in make_plan(effects, bright, 0.1).everywhere


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "assignments", "figures"),
    [
        ("adaptive-exposure", ["duration=120 ms", "imager.rows=64", "imager.columns=64"], 3),
        ("ebaps-night", ["duration=300 ms", "imager.rows=64", "imager.columns=80"], 3),
        ("emccd-window", ["duration=110 ms"], 5),
    ],
)
def test_a_shipped_scenario_runs_to_its_report(tmp_path, name, assignments, figures):
    short, loaded = load(name, assignments)
    trace = tmp_path / "trace.vcd"
    done = run_scenario(
        short, loaded, tmp_path / "run", options=Options(trace=trace), progress=Silent(), began=0.0
    )
    result, folder = done.result, done.folder
    assert result.outcome == "ok" and result.error.ci[1] <= loaded.tolerance
    drawn = [file for file in result.files if file.startswith("figures/")]
    assert len(drawn) == figures and all((folder / file).exists() for file in result.files)
    page = (folder / "report.html").read_text()
    assert "http" not in page
    assert len(read_vcd(trace)) >= 4 and any(read_vcd(trace).values())


@pytest.mark.parametrize(("clock", "outcome"), [("85 MHz", "ok"), ("39 MHz", "degraded")])
def test_a_board_that_is_too_slow_degrades_the_run(tmp_path, clock, outcome):
    short, loaded = load("ebaps-night", [
        "duration=250 ms", "imager.rows=8", "imager.columns=32",
        f"imager.board.link_clock={clock}",
    ])  # fmt: skip
    assert load_again(to_toml(loaded), tmp_path) == loaded
    done = run_scenario(
        short, loaded, tmp_path / "run", options=Options(), progress=Silent(), began=0.0,
        report=lambda machine, made: [],
    )  # fmt: skip
    metrics = done.result.metrics
    assert done.result.outcome == outcome and metrics["board_frames"].value == 1
    lost = outcome != "ok"
    assert metrics["board_pixels_wrong"].value == (256 if lost else 0)
    assert [note for note in done.outcome.notes if "39 MHz is too slow" in note] or not lost
    stages = {row.stage: row for row in done.result.latency}
    moved = stages["frame requested to its last pixel read"]
    assert moved.min_us > 256 / float(clock.split()[0])  # a pixel a clock at the most


def load_again(text, folder):
    path = folder / "again.toml"
    path.write_text(text)
    return load(str(path))[1]
