"""The command line: exit codes, one line for bad input and nothing left behind, one document with
--json, interrupting and going on."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim.run.loop
import scenarios.run
from cosim import Interrupted
from cosim.files import open_stream
from cosim.plan.error import OTHER_NOISE
from scenarios.assemble.schema.export import export
from scenarios.assemble.schema.loading import load, shipped

PROGRAM = Path(sys.executable).with_name("viform")
SET_SMALL = ("--set", "sensor.chip=spikeone", "--set", "duration=2.5 ms", "--set", "image.at=[50]")
STEP = ("run", "step", *SET_SMALL, "--set", "scene.at=1.26 ms")


def program(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """The installed command in a process of its own."""
    command = [str(PROGRAM), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs without their pictures, which take most of a small run's time."""
    monkeypatch.setattr(scenarios.run, "REPORT", lambda machine, run: [])


def words(folder: Path) -> np.ndarray:
    stream = open_stream(folder)
    return stream.read_words(0, -(-stream.cycles // 32))


# Bad input.


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run", "film", "--set", "sensor.clock=40 lux"],
         "sensor.clock must be a frequency such as '40 kHz', not '40 lux'; "
         "write --set sensor.clock='40 kHz'"),
        (["run", "film", "--set", "sensor.threshold=-5 e"],
         "sensor.threshold must be a charge such as '1000 e' and at least 1 e, not '-5 e'; "
         "write --set sensor.threshold='1000 e'"),
        (["run", "film", "--set", "sensor.treshold=5 e"],
         "sensor.treshold must be a key that is known, not an unknown key; did you mean "
         "sensor.threshold?"),
        (["run", "film", "--set", "title"],
         "--set must be KEY=VALUE such as sensor.clock='20 kHz', not 'title'; add it"),
        (["run", "film", "--tolerance", "inf"],
         "tolerance must be a finite number, not inf; see `viform list --keys`"),
        (["run", "film", "--seed", "-1"],
         "seed must be at least 0, not -1; see `viform list --keys`"),
        (["run", "nosuch"],
         f"the scenario must be one of {', '.join(shipped())} or a TOML file, not 'nosuch'; "
         "see `viform list`"),
        (["run", "film", "--resume"],
         "--resume must be given with --out, not alone; add --out and the folder"),
        (["run", "film", "--set", "image.window=40"], "image.window must be odd, not 40; set 41"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_leaves_nothing(
    refused, tmp_path, monkeypatch, arguments, expected
):
    monkeypatch.chdir(tmp_path)
    assert refused(*arguments, *(SET_SMALL if arguments[:2] == ["run", "film"] else ())) == expected
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "start"),
    [
        (["run", "film", "--bogus"], "No such option: --bogus"),
        (["bogus"], "No such command 'bogus'; see `viform --help`"),
        (["runn"], "No such command 'runn'. Did you mean 'run'?; see `viform --help`"),
        (["run", "film", "--seed", "x"], "--seed must be a whole number, not 'x'"),
        (["run", "film", "star"], "Got unexpected extra argument"),
        (["image", "a.dat", "--out", "a.png"], "Missing option '--at'; see `viform image --help`"),
        (["image"], "Missing argument"),
        (["--bogus"], "No such option: --bogus"),
    ],
)
def test_a_wrong_command_line_is_one_line_that_leads_to_the_help(refused, arguments, start):
    line = refused(*arguments)
    assert line.startswith(start)
    assert line.endswith("--help`")


@pytest.mark.parametrize(
    "write",
    [
        lambda path: path.write_bytes(np.random.default_rng(1).bytes(20_000)),
        lambda path: path.touch(),
        lambda path: path.write_text("this is no clip"),
        lambda path: path.mkdir(),
        lambda path: None,
    ],
    ids=["random bytes", "empty", "text", "a folder", "missing"],
)
def test_a_clip_that_is_none_is_refused_and_leaves_nothing(refused, tmp_path, monkeypatch, write):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "clip.mp4")
    before = sorted(tmp_path.iterdir())
    line = refused("run", "film", "--set", "scene.path=clip.mp4", "--json")
    assert line.startswith("scene.path must be a clip or image that can be decoded, not ")
    assert sorted(tmp_path.iterdir()) == before


def test_output_that_has_no_place_to_go_to_ends_without_a_traceback():
    def start(stdout: Any) -> subprocess.Popen[str]:
        return subprocess.Popen([str(PROGRAM), "list", "--json"], stdout=stdout,
                                stderr=subprocess.PIPE, text=True)  # fmt: skip

    with open("/dev/full", "w") as full, start(full) as process:
        _, err = process.communicate(timeout=120)
    assert process.returncode == 2
    assert err.startswith("viform: ") and err.count("\n") == 1, err
    assert err.endswith("at standard output; make room and repeat the command\n")

    reading, writing = os.pipe()
    os.close(reading)  # as of a `head` that has seen enough
    with open(writing, "w") as closed, start(closed) as process:
        _, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (141, "")


def test_more_light_than_a_display_shows_is_one_line(refused):
    line = refused("plan", "glass", "--set", "scene.illuminance=20 klx", "--set",
                   "sensor.lens.f_number=1.4")  # fmt: skip
    assert line.startswith("white in front of a display must be at most a spike a cycle, not 16.4")
    assert "sensor.lens.f_number" in line


def test_draws_are_chosen_and_the_error_is_named_by_its_kind(viform, refused, tmp_path):
    sets = ["--set", "sensor.width=64", "--set", "sensor.height=48", "--set", "duration=2 ms"]
    for draws, of in (("bank", "law"), ("each", "run")):
        error = json.loads(viform("plan", "film", *sets, "--draws", draws, "--json").out)["error"]
        assert error["of"] == of and (error["law"] is None) == (of == "run")
        named = {"law": "it is one in law, with other noise", "run": "it is one of the run: "}[of]
        assert named in viform("plan", "film", *sets, "--draws", draws).out
    kept = ["--report", "none", "--out", tmp_path / "run"]
    told = viform("run", "film", *sets, *kept).out
    assert "(99.9 %) in law against full physics" in told
    again = viform("run", "film", *sets, *kept, "--resume").out  # the result is read and printed
    for text in (told, again, viform("plan", "film", *sets).out):
        assert OTHER_NOISE in text
    stated = json.loads((tmp_path / "run" / "result.json").read_text())["error"]
    assert stated["of"] == "law" and stated["law"] is not None
    each = ("--draws", "each", "--report", "none", "--out", tmp_path / "each")
    assert "(99.9 %) of the run against full physics" in viform("run", "film", *sets, *each).out
    assert refused("plan", "film", "--draws", "none").startswith("draws must be 'each' or 'bank'")
    assert refused("plan", "light-link", "--draws", "each").startswith("draws must be one of ")


def test_a_plan_says_no_time_that_is_not_known(viform: Any) -> None:
    small = "sensor.continuous.width=32", "sensor.continuous.height=32", "duration=2 ms"
    sets = "sensor.pixel=continuous", *small
    words = "plan", "film", *(w for s in sets for w in ("--set", s))
    predicted = json.loads(viform(*words, "--json").out)["predicted"]
    assert predicted["full_physics_s"] is None
    text = viform(*words).out
    assert "with every effect\n" in text and "takes unknown" not in text
    assert "take unknown" not in text


def test_the_columns_of_a_plan_stand_apart(viform: Any) -> None:
    """Also where a cost has the longest text, such as 1.59 x 10^-5 ns."""
    small = "sensor.asynchronous.width=64", "sensor.asynchronous.height=64"
    text = viform("plan", "sun-and-stars", *(w for s in small for w in ("--set", s))).out
    head, *rows = text.split("\n\n")[1].splitlines()
    assert head.split()[0] == "effect" and any("10⁻⁵ ns" in row for row in rows)
    for row in rows:
        cells = re.split(r" {2,}", row)
        assert len(cells) == 4, row


def test_a_clip_in_the_place_of_a_scenario_or_stream_is_pointed_to_film(refused, clip, tmp_path):
    line = refused("run", clip)
    assert line == (
        f"the scenario must be a TOML file, not {clip}, which is not text; film a clip with "
        f"`viform run film --set scene.path={clip}`"
    )
    line = refused("image", clip, "--at", 1, "--out", tmp_path / "a.png")
    assert ".events.npz, .fsc, .vfl or the folder of a run, not " in line
    assert "`viform run film --set scene.path=...`" in line


@pytest.mark.parametrize(
    "folder", [Path("/proc/nope"), Path("x" * 300), Path(os.devnull) / "a", Path(os.devnull)]
)
def test_a_folder_that_cannot_be_made_is_refused(refused, folder):
    line = refused(*STEP, "--out", folder)
    assert line.startswith("--out must be a folder")


def test_a_folder_with_something_in_it_is_refused_and_stays_as_it_is(refused, step_run):
    before = {path: path.stat().st_mtime_ns for path in step_run.folder.rglob("*")}
    assert refused(*STEP, "--out", step_run.folder) == (
        f"--out must be a new or empty folder, not {step_run.folder}; choose another, or add "
        "--resume"
    )
    assert {path: path.stat().st_mtime_ns for path in step_run.folder.rglob("*")} == before


def test_without_opencl_a_run_says_what_to_install(tmp_path):
    (tmp_path / "vendors").mkdir()
    environment = {**os.environ, "OCL_ICD_VENDORS": str(tmp_path / "vendors")}
    done = program(*STEP, "--out", "run", cwd=tmp_path, env=environment)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "viform: the OpenCL device must be one that this machine has, not none at all; install one "
        "(apt-get install pocl-opencl-icd ocl-icd-libopencl1) or pass --device numba\n"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["vendors"]


def test_a_device_that_is_not_here_is_refused_with_those_that_are(refused, device, tmp_path):
    line = refused(*STEP, "--device", "nosuch", "--out", tmp_path / "run")
    assert line.startswith("the OpenCL device must be one that this machine has, not 'nosuch'; ")
    assert device.name in line
    assert line.endswith("; or numba")


# Good input.


def test_without_a_command_the_help_is_shown():
    done = program()
    assert done.returncode == 0
    assert "run" in done.stdout and "convert" in done.stdout
    assert done.stderr == ""


def test_list_names_what_ships(viform):
    code, out, err = viform("list")
    assert (code, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()] == list(shipped())
    document = json.loads(viform("list", "--json").out)
    assert [row["name"] for row in document["scenarios"]] == list(shipped())
    assert json.loads(viform("list", "--schema").out) == export()


@pytest.mark.usefixtures("no_report")
def test_json_prints_the_bytes_of_result_json_and_nothing_else(viform, tmp_path):
    code, out, err = viform("run", "--json", *STEP[1:], "--out", tmp_path / "run")
    assert code == 0
    assert out == (tmp_path / "run" / "result.json").read_text(encoding="utf-8")
    assert json.loads(out)["scenario"] == "step"
    assert err.startswith("viform: f/1.37 chosen so that white fires at 0.6 a cycle\n")
    assert not (tmp_path / "run" / "checkpoint.npz").exists()


@pytest.mark.usefixtures("no_report")
def test_without_json_a_run_says_its_figures_and_where_the_report_is(viform, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = viform(*STEP)
    assert code == 0
    lines = dict(line.split(maxsplit=1) for line in out.splitlines())
    assert lines["outcome"] == "ok"
    assert lines["report"] == "runs/step-1/report.html"
    assert lines["tfp_psnr"].endswith(" dB")
    assert (tmp_path / lines["report"]).with_name("result.json").is_file()


@pytest.mark.usefixtures("no_report")
def test_resume_without_a_checkpoint_starts_afresh(viform, tmp_path, step_run):
    folder = tmp_path / "run"
    shutil.copytree(step_run.folder, folder)
    (folder / "result.json").write_text("old")
    assert viform(*STEP, "--set", "image.at=[]", "--out", folder, "--resume").code == 0
    result = json.loads((folder / "result.json").read_text())
    assert result["outcome"] == "ok"
    assert [row["stage"] for row in result["throughput"]] == ["sensor", "recorder"]  # all of it ran
    np.testing.assert_array_equal(words(folder), words(step_run.folder))


# Interrupting.

LONG = (
    "run", "film", "--set", "sensor.chip=spikeone", "--set", "duration=20 ms", "--set",
    "image.at=[400]", "--device", "numba",
)  # fmt: skip
"""800 cycles: 13 blocks."""

INTERRUPTS_ITSELF = """
import os, signal, sys
from contextlib import contextmanager

import cosim.compute.stopping as stopping
import cosim.run.loop as loop
from sensor.latched.stages import SceneStage
from scenarios.cli import main

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background has it ignored
stopping.GRACE_S = 600.0  # however busy the machine is, the run may save
requests, step, stop_requests = [], SceneStage.step, loop.stop_requests

@contextmanager
def watched():
    with stop_requests() as requested:
        requests.append(requested)
        yield requested

def interrupting(self, data, block):
    if block.start == 128:
        os.kill(os.getpid(), signal.SIGINT)
        requests[-1].wait()
    return step(self, data, block)

loop.stop_requests, SceneStage.step = watched, interrupting
sys.exit(main())
"""
"""The program, which gets SIGINT in the third block of the scene and waits there until the signal
has been noted. One from outside came too late where that process did not get the processor: the
first stage is ten of the 13 blocks ahead of the recorder."""


LOST_IN_A_LIBRARY = """
import os, signal, time
from scenarios.cli import entry

def computes(arguments):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60)
    except KeyboardInterrupt:
        raise RuntimeError("no compiled object yet") from None

entry._main = computes
entry.main()
"""


def test_an_interrupt_that_a_library_takes_for_a_fault_is_one():
    """A compiler that a signal reaches within a callback raises an error of its own."""
    child = subprocess.run(
        [sys.executable, "-c", LOST_IN_A_LIBRARY], capture_output=True, text=True, timeout=60
    )
    assert (child.returncode, child.stderr) == (130, "viform: interrupted\n")


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory, make_clip: Callable[..., Path]) -> Path:
    frames = np.random.default_rng(1).integers(0, 256, (25, 250, 400), np.uint8)
    return make_clip(tmp_path_factory.mktemp("clip") / "noise.mkv", frames, 1000)


@pytest.mark.usefixtures("no_report")
def test_an_interrupted_run_goes_on_to_the_same_stream(refused, viform, film, clip, tmp_path):
    folder = tmp_path / "run"
    command = [*LONG, "--set", f"scene.path={clip}", "--out", str(folder)]
    child = subprocess.run(
        [sys.executable, "-c", INTERRUPTS_ITSELF, *command], capture_output=True, text=True
    )
    out, err = child.stdout, child.stderr
    assert child.returncode == 130, err
    assert out == ""
    found = re.fullmatch(
        r"viform: interrupted after (\d+) of 800 cycles; go on with the same command and "
        rf"--out {re.escape(str(folder))} --resume",
        err.splitlines()[-1],
    )
    assert found and 192 <= int(found[1]) <= 320, err  # the block, and at most two ahead of it
    assert "Traceback" not in err

    assert sorted(path.name for path in folder.iterdir()) == [
        "checkpoint.npz", "scenario.toml", "stream.zarr",
    ]  # fmt: skip
    line = refused("image", folder, "--at", 1, "--out", tmp_path / "a.png")
    assert "not one that was interrupted; finish it: viform run " in line
    assert line.endswith(f"--resume --out {folder}")
    assert not (tmp_path / "a.png").exists()

    # A run with other inputs may not go on from here, and leaves everything as it is.
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    line = refused(*command, "--resume", "--seed", 2)
    assert line == (
        f"--resume must be given for the run that {folder} holds ('A spike camera films a clip': "
        "seed 1), not for film: seed 2; give another --out"
    )
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before

    code, out, _ = viform(*command, "--resume", "--json", "--set", "title=changed since")
    assert code == 0
    assert json.loads(out)["throughput"] == []
    assert load(str(folder))[1].title == "changed since"
    _, whole = film(
        "film", tmp_path / "whole", "duration=20 ms", "image.at=[400]", f"scene.path={clip}",
        device="numba",  # the exact tier; on OpenCL the tolerance allows the fast one
    )  # fmt: skip
    np.testing.assert_array_equal(words(folder), words(whole))
    assert not (folder / "checkpoint.npz").exists()


def test_an_end_of_a_file_in_our_own_work_is_no_interruption(viform, monkeypatch):
    def read() -> list[Any]:
        raise EOFError("Ran out of input")

    monkeypatch.setattr("scenarios.cli.maintenance.doctor.run_checks", read)
    with pytest.raises(EOFError, match="Ran out of input"):
        viform("doctor")


def test_a_run_interrupted_in_its_report_need_not_film_again(film, step_run, tmp_path, monkeypatch):
    folder = tmp_path / "run"

    def stop(machine: Any, run: Any) -> list[str]:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="100 of 100 cycles, before the images and the report"):
        film("step", folder, "scene.at=1.26 ms", report=stop)
    assert not (folder / "result.json").exists()
    chunks = {path: path.stat().st_mtime_ns for path in (folder / "stream.zarr").rglob("*")}
    read: list[Path] = []
    load_arrays = cosim.run.loop.load_arrays
    monkeypatch.setattr(
        "cosim.run.loop.load_arrays", lambda path: read.append(path) or load_arrays(path)
    )
    result, _ = film("step", folder, "scene.at=1.26 ms", resume=True)
    assert read == [folder / "checkpoint.npz"]  # once
    assert result.outcome == "ok"
    assert {p: p.stat().st_mtime_ns for p in (folder / "stream.zarr").rglob("*")} == chunks
    np.testing.assert_array_equal(words(folder), words(step_run.folder))


def test_going_on_without_the_stream_begins_again(film, viform, tmp_path):
    folder = tmp_path / "run"

    def stop(machine: Any, run: Any) -> list[str]:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        film("step", folder, "scene.at=1.26 ms", report=stop)
    shutil.rmtree(folder / "stream.zarr")
    code, _, err = viform(*STEP, "--out", folder, "--resume")
    assert code == 0 and (folder / "result.json").exists()
    assert (
        f"viform: {folder / 'stream.zarr'} must be as the run wrote it, not lost; the run "
        "begins again at its first cycle\n"
    ) in err


def test_a_run_stores_its_stream_as_it_is_told(viform, refused, tmp_path):
    small = ("--set", "sensor.width=96", "--set", "sensor.height=64", "--set", "duration=4 ms",
             "--set", "scene.at=1 ms", "--set", "image.at=[80]", "--device", "numba")  # fmt: skip
    sizes = {}
    for store in ("raw", "small"):
        folder = tmp_path / store
        assert viform("run", "step", *small, "--store", store, "--out", folder).code == 0
        chunks = (folder / "stream.zarr" / "words" / "c").rglob("*")
        sizes[store] = sum(path.stat().st_size for path in chunks if path.is_file())
    assert sizes["raw"] >= 160 // 8 * 96 * 64 > 1.5 * sizes["small"]
    np.testing.assert_array_equal(words(tmp_path / "raw"), words(tmp_path / "small"))
    said = refused("run", "step", "--store", "tiny", "--out", tmp_path / "no")
    assert said == "--store must be one of raw, fast, small, none, not tiny; choose one"
    said = refused("run", "step", "--report", "pdf", "--out", tmp_path / "no")
    assert said == "--report must be one of page, none, not pdf; choose one"
    assert not (tmp_path / "no").exists()


def test_keys_are_listed_by_their_beginning(viform: Any) -> None:
    lines = viform("list", "--keys", "link.panel.p").out.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["link.panel.phase", "link.panel.pitch"]
    (key,) = json.loads(viform("list", "--keys", "link.panel.pitch", "--json").out)["keys"]
    assert (key["name"], key["default"]) == ("link.panel.pitch", '"500 um"')


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--keys", "zz"], "PREFIX must be the beginning of a key, such as link.panel, not zz"),
        (["link"], "PREFIX must be given with --keys alone, not link"),
    ],
)
def test_a_wrong_beginning_is_refused(refused: Any, words: list[str], message: str) -> None:
    assert refused("list", *words).startswith(message)
