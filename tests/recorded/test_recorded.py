"""Every scenario that ships gives the bits, figures, plans and errors that were recorded of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.recorded.cases import CASES, Case
from tests.recorded.recording import RECORDED, differences, record

RECORDS = json.loads(RECORDED.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=() if case.quick else pytest.mark.slow)
        for case in CASES
    ],
)
def test_a_command_gives_what_was_recorded(case: Case, tmp_path: Path) -> None:
    now = json.loads(json.dumps(record(case.words, tmp_path / "run")))
    assert differences(RECORDS[case.name], now) == []


def test_every_case_is_recorded_and_a_change_is_seen() -> None:
    assert set(RECORDS) == {case.name for case in CASES}
    was = {"metrics": {"psnr": 31.0, "rate": 0.1}, "kept": ["shot noise"]}
    assert differences(was, was) == []
    assert differences(was, {"metrics": {"psnr": 31.0, "rate": 0.1 * (1 + 1e-12)}, "kept": []}) == [
        "/kept: ['shot noise'] became []"
    ]
    assert differences(was, {"kept": ["shot noise"]}) == ["/metrics: is gone"]
    assert differences({"a": 1.0}, {"a": 1.1, "b": 2}) == ["/a: 1.0 became 1.1", "/b: is new"]
