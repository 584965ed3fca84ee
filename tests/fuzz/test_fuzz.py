"""Damaged inputs end in a line: 1e4 in the suite, 1e6 behind the marker, and those kept for what
they found."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.engine import Target, run
from tests.fuzz.targets import TARGETS

QUICK, SLOW = 10_000, 1_000_000
"""Cases of all targets together."""

each_target = pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)


@each_target
def test_damaged_input_is_read_or_refused_in_a_line(target: Target, tmp_path: Path) -> None:
    assert run(target, 0, QUICK // len(TARGETS) // target.weight + 1, tmp_path) == []


@pytest.mark.slow
@each_target
def test_a_million_damaged_inputs(target: Target, tmp_path: Path) -> None:
    assert run(target, QUICK, SLOW // len(TARGETS) // target.weight + 1, tmp_path) == []


KEPT = {"event arrays": (17152, 44517), "settings": (23662,), "tape": (13387,), "config": (41457,),
        "log": (10339,), "judged log": (14783,), "picture": (21275,)}  # fmt: skip
"""Numbers of cases that failed once: time or memory out of proportion, an error of numpy, or a
limit of FFmpeg that was called a lack of memory."""
AROUND = 5
"""Cases before and after, whose time is the usual one."""


@pytest.mark.parametrize(
    ("name", "number"), [(k, n) for k, numbers in KEPT.items() for n in numbers]
)
def test_a_case_that_failed_once_does_not_again(name: str, number: int, tmp_path: Path) -> None:
    (target,) = (t for t in TARGETS if t.name == name)
    assert run(target, number - AROUND, 2 * AROUND + 1, tmp_path) == []
