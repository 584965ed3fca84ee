"""bench loop: whole chains run in the lengths that it times, and its rows as programs read them."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

import scenarios.studies.bench.display as loop
from cosim.errors import Interrupted
from cosim.run.chain import BlockChain
from scenarios.cli.entry import _main
from tests.scenarios.studies.bench.small import make_bench_small


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small chips; the timed runs are as short as the first."""
    make_bench_small(monkeypatch, "loop", "sensor")


def rows(viform: Callable[..., Any]) -> list[dict[str, Any]]:
    answer = viform("bench", "loop", "--json")
    assert answer.code == 0, answer.err
    found: list[dict[str, Any]] = json.loads(answer.out)["rows"]
    chains = [row["name"] for row in found if row["tier"] == "chain"]
    assert chains == list(loop.LOOPS)
    for row in found:
        assert row["unit"] == "planes/s" and row["value"] > 0 and row["ceiling_ratio"] is None
        assert row["realtime"] == pytest.approx(row["value"] / 40e3)
        assert (row["plain_ratio"] is None) == (row["tier"] == "stage")
    return found


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_bench_loop_prints_the_documented_rows(viform: Callable[..., Any]) -> None:
    stages = {row["name"] for row in rows(viform)}
    assert {"loop.glass.sensor", "loop.glass.display"} <= stages
    assert {"loop.glass-over-light.code", "loop.glass-over-light.receiver"} <= stages


@pytest.mark.usefixtures("small")
def test_every_run_of_bench_loop_is_one_that_its_scenario_allows(
    viform: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    glass = {"loop.glass": loop.LOOPS["loop.glass"]}  # the clock of the other locks for seconds
    monkeypatch.setattr(loop, "LOOPS", glass)
    monkeypatch.setattr(BlockChain, "run", lambda *_: {"sensor": 0.5})
    for row in rows(viform):
        assert row["tier"] == "chain" or row["value"] == 80 / 0.5  # cycles a second


@pytest.mark.usefixtures("small")
def test_an_interruption_names_no_folder_that_is_gone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: object) -> None:
        raise Interrupted(3, 80, "go on with --out /tmp/gone --resume")

    monkeypatch.setattr(BlockChain, "run", stop)
    assert _main(["bench", "loop"]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "viform: interrupted"
