"""The folder of a run: one run at a time, and room for it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosim import InputError
from cosim.run.folder import check_room, claim_folder
from scenarios.cli.entry import _main


def test_two_runs_that_start_at_once_get_two_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with claim_folder("film", None, False) as one, claim_folder("film", None, False) as two:
        assert (one, two) == (Path("runs/film-1"), Path("runs/film-2"))
        assert one.is_dir() and two.is_dir()


def test_a_name_taken_between_looking_and_making_is_not_shared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    import cosim.run.folder

    found, asked = cosim.run.folder.output_folder, []

    def slow(*words: object, **named: object) -> Path:
        place = found(*words, **named)  # type: ignore[arg-type]
        if not asked:
            place.mkdir(parents=True)  # by another run
        asked.append(place)
        return place

    monkeypatch.setattr(cosim.run.folder, "output_folder", slow)
    with claim_folder("film", None, False) as folder:
        assert folder == Path("runs/film-2")


def test_a_folder_that_a_run_is_writing_is_refused(tmp_path: Path) -> None:
    with claim_folder("film", tmp_path / "d", False):
        second = claim_folder("film", tmp_path / "d", True)
        with pytest.raises(InputError, match="that no other run is writing"):
            second.__enter__()
    with claim_folder("film", tmp_path / "d", True) as folder:  # free again
        assert folder == tmp_path / "d"


def test_a_stream_larger_than_the_disk_is_refused_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    check_room(tmp_path / "not" / "yet", 8)
    out = tmp_path / "d"
    assert _main(["run", "step", "--set", "duration=1 day", "--out", str(out)]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1 and "small enough for the" in text and "shorten duration" in text
    assert not out.exists()


def test_a_request_to_end_is_met_as_an_interrupt(tmp_path: Path) -> None:
    out = tmp_path / "d"
    words = ["run", "step", "--set", "sensor.chip=spikeone", "--set", "duration=2 s"]
    code = "import sys; from scenarios.cli import main; sys.argv[1:] = sys.argv[1:]; main()"
    child = subprocess.Popen(
        [sys.executable, "-c", code, *words, "--out", str(out)], stderr=subprocess.PIPE, text=True
    )
    while not (out / "stream.zarr" / "words").exists():
        assert child.poll() is None
        time.sleep(0.02)
    os.kill(child.pid, signal.SIGTERM)
    _, text = child.communicate(timeout=60)
    assert child.returncode == 130, text
    assert "--resume" in text and "Traceback" not in text
    assert (out / "checkpoint.npz").exists() and not (out / "result.json").exists()


def test_a_clip_whose_name_is_not_utf8_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = os.fsdecode(os.fsencode(tmp_path) + b"/clip\xff.mp4")
    assert _main(["run", "film", "--set", f"scene.path={name}", "--out", str(tmp_path / "d")]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1 and "scene.path must be the name of a file" in text
