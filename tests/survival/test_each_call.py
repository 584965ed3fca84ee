"""A run that is killed before each call that syncs, renames or removes: the next one ends with the
same bytes, and nothing else is left."""

from __future__ import annotations

import hashlib
import json
from functools import partial
from pathlib import Path

import pytest

from tests.survival.forked import Command
from tests.survival.spine import run

STEP = 27
"""Every so many calls in the ordinary suite."""


def contents(folder: Path) -> dict[str, str]:
    """SHA-256 of every file; of the result without its time."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            data = path.read_bytes()
            if path.name == "result.json":
                data = json.dumps(json.loads(data) | {"run_time_s": 0}).encode()
            found[str(path.relative_to(folder))] = hashlib.sha256(data).hexdigest()
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, str], int]:
    """What a run leaves that nothing happened to, and the number of its calls."""
    place = tmp_path_factory.mktemp("whole")
    code = Command((), place / "log", partial(run, place / "run")).wait()
    assert code == 0, (place / "log").read_text()
    return contents(place / "run"), int((place / "run.calls").read_text())


def check(number: int, whole: tuple[dict[str, str], int], place: Path) -> None:
    folder, log = place / str(number), place / "log"
    assert Command((), log, partial(run, folder, number)).wait() == -9, log.read_text()
    assert Command((), log, partial(run, folder)).wait() == 0, log.read_text()
    assert contents(folder) == whole[0], number


def test_kills_at_some_calls(whole: tuple[dict[str, str], int], tmp_path: Path) -> None:
    assert whole[1] > 50
    for number in range(3, whole[1] + 1, STEP):
        check(number, whole, tmp_path)


@pytest.mark.slow
def test_kills_at_every_call(whole: tuple[dict[str, str], int], tmp_path: Path) -> None:
    for number in range(1, whole[1] + 1):
        check(number, whole, tmp_path)
