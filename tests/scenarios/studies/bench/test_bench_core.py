"""bench core: its rows as programs read them, and that each way does what it is timed for."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import scenarios.studies.bench.core as core
from cosim.run.timing import least_of
from tests.scenarios.studies.bench.small import make_bench_small


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Small clips; what the timed ways make, in their order."""
    make_bench_small(monkeypatch, "core")
    made: list[Any] = []

    def spy(calls: list[Callable[[], Any]], repeats: int = 1) -> list[float]:
        made.extend(call() for call in calls)
        return least_of(calls, 1)

    monkeypatch.setattr(core, "least_of", spy)
    return made


def test_bench_core_prints_the_documented_rows(made: list[Any], viform: Callable[..., Any]) -> None:
    answer = viform("bench", "core", "--json")
    assert answer.code == 0, answer.err
    rows = json.loads(answer.out)["rows"]
    assert [(row["name"], row["tier"]) for row in rows] == [
        ("core.film", "planned"), ("core.film", "fast"), ("core.film", "exact"),
        ("core.push", "fast"), ("core.show", "exact"), ("core.film-large", "fast"),
    ]  # fmt: skip
    for row in rows:
        assert row["unit"] == "pixel-cycles/s" and row["value"] > 0
        assert (row["plain_ratio"] is None) == (row["name"] == "core.push")
        assert row["realtime"] > 0 and row["ceiling_ratio"] > 0
    plain, *films, seen, integrated = made[:6]
    for spikes in films:
        assert spikes.cycles == len(plain)
        assert abs(spikes.rate() - plain.mean(axis=0)).mean() < 0.06
    assert seen.shape == integrated.shape and 0.2 < integrated.mean() < 1
    # The drive holds the light until the next spike; numpy takes each spike as a packet.
    np.testing.assert_allclose(seen.mean(axis=(1, 2)), integrated.mean(axis=(1, 2)), rtol=0.1)
