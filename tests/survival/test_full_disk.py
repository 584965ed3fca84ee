"""Runs of every kind on disks that become full after any number of bytes, or are read-only: one
line that says so, and a folder that resumes to the same result."""

from __future__ import annotations

import json
import sys
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from tests.survival.commands import RUNS
from tests.survival.forked import call
from tests.survival.small_disk import mount_private, resize
from tests.survival.test_kills import state

STEPS = 40
"""Sizes of the disk behind the marker, from nothing to all that a run writes."""
QUICK = {"latched": 20, "asynchronous": 9}
"""The step of each kind in the ordinary suite."""
ROOM = 1 << 30


def viform(*words: str) -> tuple[int, str]:
    """Exit code and standard error of a command in this process."""
    from scenarios.cli.entry import main

    sys.argv = ["viform", *words]
    with redirect_stderr(StringIO()) as errors, redirect_stdout(StringIO()):
        try:
            main()
        except SystemExit as exc:
            return int(str(exc.code)), errors.getvalue()
    raise AssertionError("a command must exit")


def used(folder: Path) -> int:
    """Bytes that a folder takes on a disk of 4 KiB pages."""
    return sum(-(-path.stat().st_size // 4096) * 4096 for path in folder.rglob("*"))


def refusal(code: int, errors: str) -> str:
    """The line of a refused command, after checks of its form."""
    lines = [line for line in errors.splitlines() if line.startswith("viform: ")]
    assert code == 2, errors
    assert "Traceback" not in errors and lines and errors.splitlines()[-1] == lines[-1], errors
    return lines[-1]


def whole(kind: str, place: Path) -> dict[str, Any]:
    """State of a run with room enough, and the bytes that it takes."""
    code, errors = viform("run", *RUNS[kind], "--out", str(place / "run"))
    assert code == 0, errors
    return {"state": state(place / "run"), "bytes": used(place / "run")}


def small(kind: str, place: Path, size: int) -> dict[str, Any]:
    """Outcome of a run on a disk of `size` bytes, and of its resumption with room."""
    mount_private(place, size)
    folder, words = place / "run", ("run", *RUNS[kind])
    code, errors = viform(*words, "--out", str(folder))
    line = "" if code == 0 else refusal(code, errors)
    resize(place, ROOM)
    if code:
        resume = ("--resume",) if (folder / "scenario.toml").exists() else ()
        code, errors = viform(*words, "--out", str(folder), *resume)
    return {"line": line, "code": code, "errors": errors,
            "state": state(folder) if code == 0 else None}  # fmt: skip


def read_only(kind: str, place: Path) -> dict[str, Any]:
    """Refusals of a run on a read-only disk: of a new folder, and of one that has begun."""
    mount_private(place, 64 << 10)
    resize(place, ROOM, read_only=True)
    folder, words = place / "run", ("run", *RUNS[kind])
    new = refusal(*viform(*words, "--out", str(folder)))
    resize(place, 64 << 10)
    refusal(*viform(*words, "--out", str(folder)))
    resize(place, ROOM, read_only=True)
    resume = ("--resume",) if (folder / "scenario.toml").exists() else ()
    begun = refusal(*viform(*words, "--out", str(folder), *resume))
    return {"new": new, "begun": begun}


@pytest.fixture(scope="module", params=RUNS)
def finished(request: pytest.FixtureRequest, tmp_path_factory: Any) -> Any:
    """Kind, and state and bytes of its run."""
    place = tmp_path_factory.mktemp("finished")
    return request.param, call(partial(whole, request.param, place), place)


def check(finished: Any, step: int, place: Path) -> None:
    """Runs on a disk that holds `step` of STEPS parts of what the run writes."""
    kind, expected = finished
    disk = place / "disk"
    disk.mkdir()
    got = call(partial(small, kind, disk, expected["bytes"] * step // STEPS), place)
    if got["line"]:
        line = got["line"].replace(str(disk), "DISK")
        assert ("room" in line or "free at" in line) and len(line) < 400, line
    assert got["code"] == 0, got["errors"]
    assert got["state"] == json.loads(json.dumps(expected["state"]))


@pytest.mark.parametrize("finished", QUICK, indirect=True)
def test_a_full_disk_is_one_line_and_the_run_resumes(finished: Any, tmp_path: Path) -> None:
    check(finished, QUICK[finished[0]], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("step", range(STEPS))
def test_a_disk_of_any_size(finished: Any, step: int, tmp_path: Path) -> None:
    check(finished, step, tmp_path)


@pytest.mark.parametrize("kind", ["latched", "emccd"])
def test_a_read_only_disk_is_one_line(kind: str, tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    got = call(partial(read_only, kind, disk), tmp_path)
    assert "read-only" in got["new"].lower() and "read-only" in got["begun"].lower(), got
