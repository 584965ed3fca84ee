"""The section of a report on its run time."""

from __future__ import annotations

import re

import pytest

from cosim.report.parts import run_time
from cosim.run.result import Result, Throughput


def rows_of(page: str) -> list[tuple[str, str]]:
    found = re.findall(r"<tr><td[^>]*>(.*?)</td><td[^>]*>(.*?)</td></tr>", page)
    return [(stage, took.replace("&nbsp;", " ")) for stage, took in found]


@pytest.fixture
def result() -> Result:
    rate = Throughput("sensor", 2e9, "pixel-cycles/s")
    return Result("film", "ok", 1, "a <device>", 0.064, 1e-3, throughput=[rate])


def test_stages_and_all_else_add_up_to_the_total(result: Result) -> None:
    page = run_time(result, {"sensor": 2.0, "report": 3.0}, 9.0)
    *rows, throughput, peak = rows_of(page)
    assert rows == [
        ("sensor", "2 s"), ("report", "3 s"), ("start, plan, images and all else", "4 s"),
        ("total", "9 s"),
    ]  # fmt: skip
    assert throughput[0] == "sensor throughput" and peak[0] == "peak memory"
    assert "On a &lt;device&gt;." in page and "side by side" not in page


def test_stages_side_by_side_have_no_rest_and_the_total_stays(result: Result) -> None:
    page = run_time(result, {"sensor": 6.0, "display": 5.0}, 9.0)
    assert [row[0] for row in rows_of(page)][:3] == ["sensor", "display", "total"]
    assert ("total", "9 s") in rows_of(page) and "Stages run side by side" in page
