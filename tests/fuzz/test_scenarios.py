"""Random scenarios run or are refused in a line that mends them: 20 in the suite, 2000 behind the
marker. `python -m tests.fuzz.judging N` runs the scenario of a number and prints it."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from tests.fuzz import judging
from tests.fuzz.judging import run_all
from tests.fuzz.scenarios import LATER, draw

QUICK = (1, 3, 4, 7, 8, 12, 13, 16, 18, 20, 21, 22, 25, 37, 40, 45, 47, 48, 55, 58)
"""Quick ones of many kinds: latched, asynchronous and continuous pixels, imagers, recordings,
displays and cameras; half of them run."""
UNPROPOSED = 5
"""Those of them, at most, whose refusal proposes nothing that a program can apply."""
WHOLE, CHUNK = 2000, 100
SILICON = (2147, 2192, 2221)
"""Those of the preset silicon before a display, of which two run for some 40 s each."""


def _wrong(numbers: range | tuple[int, ...], folder: Path) -> list[str]:
    return [
        f"scenario {case.number}: {why}" for case in run_all(numbers, folder) for why in case.wrong
    ]


def test_random_scenarios(tmp_path: Path) -> None:
    cases = run_all(QUICK, tmp_path)
    assert [f"scenario {case.number}: {why}" for case in cases for why in case.wrong] == []
    assert sum(case.code in (0, 1) for case in cases) >= len(QUICK) // 2
    assert sum(bool(case.unproposed) for case in cases) <= UNPROPOSED


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, WHOLE, CHUNK))
def test_two_thousand_random_scenarios(first: int, tmp_path: Path) -> None:
    assert _wrong(range(first, first + CHUNK), tmp_path) == []


@pytest.mark.slow
def test_silicon_before_a_display(tmp_path: Path) -> None:
    assert min(SILICON) >= LATER
    assert _wrong(SILICON, tmp_path) == []


@pytest.mark.slow
def test_what_does_not_end_or_dies_is_a_finding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(judging, "FLOOR_S", 0.01)
    with judging.Worker(tmp_path) as worker:
        (late,) = worker.run(3).wrong
        assert late.startswith("not ended in ")
        monkeypatch.setattr(judging, "FLOOR_S", 60.0)
        assert worker.run(3).wrong == []  # by another process
        assert worker._process is not None
        os.kill(worker._process.pid, signal.SIGKILL)
        assert worker.run(3).wrong == ["the process ended with -9"]


def test_a_scenario_is_drawn_again_from_its_number() -> None:
    assert draw(7) == draw(7) != draw(8)
