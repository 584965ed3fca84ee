"""--resume into a folder that holds a run: the same one done, the same one with other values, or
another kind. Nothing in the folder is touched."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cosim.config.toml import to_toml
from cosim.run.folder import begin_folder
from cosim.run.result import dumps, read_result
from scenarios.assemble.schema.loading import load

SETS = (
    "sensor.chip=spikeone", "duration=2.5 ms", "image.at=[]", "scene.at=1.26 ms",
)  # fmt: skip
"""What `step_run` was made with, its title aside."""
SAME = ("run", "step", *(word for text in SETS for word in ("--set", text)))


def stamps(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


@pytest.fixture
def done(step_run: Any, tmp_path: Path) -> Path:
    """A finished run."""
    shutil.copytree(step_run.folder, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture(autouse=True)
def nothing_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*words: object, **named: object) -> None:
        raise AssertionError("a run began")

    monkeypatch.setattr("scenarios.run.assemble", fail)


def test_a_run_that_is_done_is_printed_and_not_made_again(viform, done):
    before = stamps(done)
    code, out, err = viform(*SAME, "--out", done, "--resume", "--json")
    assert (code, out) == (0, (done / "result.json").read_text(encoding="utf-8"))
    assert err.startswith(f"viform: already done in {done}, on ") and err.count("\n") == 1
    code, out, err = viform(*SAME, "--out", done, "--resume")
    assert code == 0 and "already done" in err
    assert out.splitlines()[-1].split() == ["report", str(done / "report.html")]
    assert viform("run", done, "--out", done, "--resume").code == 0
    assert stamps(done) == before


def test_a_run_that_failed_ends_as_it_did(viform, done):
    told = json.loads((done / "result.json").read_text(encoding="utf-8"))
    (done / "result.json").write_text(dumps(told | {"outcome": "failed"}) + "\n")
    assert viform(*SAME, "--out", done, "--resume").code == 1


def test_waveforms_of_a_run_that_is_done_are_refused(refused, tmp_path):
    name, imager = load("emccd-window")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "scenario.toml").write_text(to_toml(imager))
    (tmp_path / "run" / "result.json").write_text(_result(name))
    command = ("run", "emccd-window", "--out", tmp_path / "run", "--resume")
    assert refused(*command, "--trace", tmp_path / "a.vcd") == (
        "--trace must be given with a run that is not complete, not given with "
        f"{tmp_path / 'run'}, which is complete; give another --out"
    )


def _result(name: str) -> str:
    return dumps({
        "scenario": name, "outcome": "ok", "seed": 1, "version": "0", "device": "none",
        "renderer": None, "simulated_s": 1.0, "run_time_s": 1.0,
        "error": {"value": None, "kind": None, "ci": None, "tolerance": 0.0},
        "plan": {"kept": [], "left_out": []}, "metrics": {}, "latency": [], "throughput": [],
        "files": [],
    }) + "\n"  # fmt: skip


@pytest.mark.parametrize(
    ("words", "differ"),
    [
        ((*SAME, "--seed", 7), ("step: seed 1", "step: seed 7")),
        ((*SAME, "--set", "scene.before=0.2"),
         ("step: scene.before 0.1", "step: scene.before 0.2")),
        ((*SAME, "--set", "sensor.crosstalk=0.1", "--seed", "2"),
         ("step: seed 1, sensor.crosstalk 0.0", "step: seed 2, sensor.crosstalk 0.1")),
        (("run", "bring-up"), ("step", "bring-up")),
        (("run", "light-link"), ("step", "light-link")),
        (("run", "emccd-window"), ("step", "emccd-window")),
        ((*SAME, "--set", "sensor.pixel=asynchronous"), ("step: ", "step: ")),
        ((*SAME, "--set", "sensor.pixel=continuous"), ("step: ", "step: ")),
    ],
)  # fmt: skip
@pytest.mark.parametrize("finished", [True, False])
def test_another_run_is_refused_and_nothing_is_touched(refused, done, words, differ, finished):
    if not finished:
        (done / "result.json").unlink()
        (done / "checkpoint.npz").write_bytes(b"of the run")
    before = stamps(done)
    line = refused(*words, "--out", done, "--resume")
    start = f"--resume must be given for the run that {done} holds ("
    assert line.startswith(start) and line.endswith("; give another --out")
    assert line.removeprefix(start).startswith("step" if finished else "'A step <script>")
    there, here = (part.partition(": ")[2] for part in differ)
    assert there in line and f", not for {differ[1]}" in line and here in line
    assert stamps(done) == before


def test_a_scenario_that_cannot_be_read_is_refused(refused, done):
    (done / "scenario.toml").write_text("title = 3\n")
    line = refused(*SAME, "--out", done, "--resume")
    assert line.startswith("--resume must be given with a run's folder, not ")
    assert line.endswith("give another --out")


def test_a_folder_of_a_name_too_long_is_one_line(refused):
    assert refused(*SAME, "--out", "x" * 300, "--resume").startswith("--out must be a folder that")


@pytest.mark.parametrize("readout", ["asynchronous", "continuous"])
def test_runs_of_every_readout_are_known_again(viform, tmp_path, readout):
    """Such a run writes its section out with what it has by default."""
    from scenarios.assemble.source import asynchronous, continuous

    name, asked = load("step", [f"sensor.pixel={readout}"])
    whole: Callable[..., Any] = {"asynchronous": asynchronous, "continuous": continuous}[
        readout
    ].with_defaults
    tmp_path.joinpath("scenario.toml").write_text(to_toml(whole(asked)))
    tmp_path.joinpath("result.json").write_text(_result(name))
    code, out, _ = viform(
        "run", "step", "--set", f"sensor.pixel={readout}", "--out", tmp_path, "--resume", "--json"
    )
    assert (code, out) == (0, _result(name))


@pytest.mark.parametrize("scenario", ["light-link", "ebaps-night", "film", "glass"])
def test_a_scenario_is_itself_after_a_run(viform, tmp_path, scenario):
    name, asked = load(scenario)
    tmp_path.joinpath("scenario.toml").write_text(to_toml(asked))
    tmp_path.joinpath("result.json").write_text(_result(name))
    verdict = {"said": "delivered", "told": "1,000 bytes"}
    tmp_path.joinpath("verdict.json").write_text(json.dumps(verdict))
    code, out, _ = viform("run", scenario, "--out", tmp_path, "--resume")
    assert code == 0 and "delivered: 1,000 bytes" in out


@pytest.mark.parametrize(
    ("name", "key"), [("film", "scene.path"), ("light-link", "link.file")]
)  # fmt: skip
def test_a_run_that_is_done_of_a_file_that_has_changed_is_refused(
    viform, refused, tmp_path, name, key
):
    given, folder = tmp_path / "given", tmp_path / "run"
    given.write_bytes(b"before")
    folder.mkdir()
    begin_folder(folder, to_toml(load(name, [f"{key}={given}"])[1]))
    (folder / "result.json").write_text(_result(name))
    command = ("run", name, "--set", f"{key}={given}", "--out", folder, "--resume")
    assert viform(*command, "--json")[:2] == (0, _result(name))
    given.write_bytes(b"after")
    before = stamps(folder)
    assert refused(*command) == (
        f"--resume must be given for the {key} that {folder} was computed from, not for {given}, "
        "which has changed since; give another --out"
    )
    assert stamps(folder) == before
    given.unlink()  # what was found of it stands
    assert viform(*command, "--json")[:2] == (0, _result(name))


def test_a_result_is_read_as_it_was_written(step_run, tmp_path):
    again = read_result(step_run.folder)
    assert again is not None
    text = (step_run.folder / "result.json").read_text(encoding="utf-8")
    assert dumps(again.document()) + "\n" == text
    assert read_result(tmp_path) is None
    (tmp_path / "result.json").write_text("old")
    assert read_result(tmp_path) is None


@pytest.mark.parametrize("told", [{"fashion": 1}, {"metrics": {"psnr": 3.0}}, {"latency": None}])
def test_a_result_of_another_version_is_not_run_over(refused, done, told):
    result = json.loads((done / "result.json").read_text(encoding="utf-8"))
    (done / "result.json").write_text(dumps(result | told))
    before = stamps(done)
    assert refused(*SAME, "--out", done, "--resume") == (
        f"{done / 'result.json'} must be one that this version writes, not one with other fields; "
        "remove it to run again here, or give another --out"
    )
    assert stamps(done) == before


def test_a_result_of_an_older_version_is_said_to_be_one(viform, done):
    result = json.loads((done / "result.json").read_text(encoding="utf-8"))
    (done / "result.json").write_text(dumps(result | {"version": "0.0.1"}))
    assert ", by version 0.0.1; to run it again" in viform(*SAME, "--out", done, "--resume").err
