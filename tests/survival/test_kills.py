"""Runs of every kind that are killed at random moments and resumed: the same bits, metrics and
files as a run that was left alone."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest

from tests.recorded.recording import left_behind, plain
from tests.survival.commands import RUNS, often
from tests.survival.forked import Command

QUICK = {"latched": 2, "asynchronous": 1}
"""Kills of each kind in the ordinary suite; a kind that is absent takes too long."""
SLOW = 25
"""Kills of each kind behind the marker."""
MOST = 3
"""Kills of one run."""


def state(folder: Path) -> dict[str, Any]:
    """Everything in a complete folder that does not depend on time."""
    document = json.loads((folder / "result.json").read_text())
    names = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    return {"document": plain(document), "left": left_behind(folder), "files": names}


def run(words: tuple[str, ...], folder: Path, log: Path) -> Command:
    """Starts a run, or resumes the one in the folder, as its user would."""
    resume = ("--resume",) if (folder / "scenario.toml").exists() else ()
    return Command(("run", *words, "--out", str(folder), *resume), log, often)


@pytest.fixture(
    scope="module",
    params=[pytest.param(kind, marks=() if kind in QUICK else pytest.mark.slow) for kind in RUNS],
)
def untouched(request: pytest.FixtureRequest, tmp_path_factory: Any) -> Any:
    """Kind, words, state and duration of a run that is left alone."""
    kind, folder = request.param, tmp_path_factory.mktemp("untouched")
    command = run(RUNS[kind], folder / "run", folder / "log")
    assert command.wait() == 0, (folder / "log").read_text()
    return kind, state(folder / "run"), command.seconds


def check(untouched: Any, first: int, kills: int, place: Path) -> None:
    """Kills runs `first`, `first` + 1, ... at random moments, `kills` times in all. The run left
    alone may have compiled kernels, so a shorter duration replaces its own."""
    kind, expected, seconds = untouched
    number, killed = first, 0
    while killed < kills:
        rng = random.Random(f"{kind}:{number}")
        folder, log = place / str(number), place / "log"
        for part in range(min(MOST, kills - killed)):
            command = run(RUNS[kind], folder, log)
            if command.wait(rng.random() * 1.05 * seconds) is not None:
                seconds = seconds if part else min(seconds, command.seconds)
                break
            command.kill()
            killed += 1
        code = run(RUNS[kind], folder, log).wait()
        assert code == 0, f"{kind}:{number}: {log.read_text()}"
        assert state(folder) == expected, f"{kind}:{number}"
        number += 1


def test_a_killed_run_resumes_to_the_same_result(untouched: Any, tmp_path: Path) -> None:
    check(untouched, 0, QUICK.get(untouched[0], 1), tmp_path)


@pytest.mark.slow
def test_many_kills(untouched: Any, tmp_path: Path) -> None:
    check(untouched, 1000, SLOW, tmp_path)
