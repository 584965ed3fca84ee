"""bench core: its rows as programs read them, and that each way does what it is timed for."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import scenarios.studies.bench.core as core
from cosim.compute.opencl import Device
from cosim.run.timing import least_of
from scenarios.studies.bench.core import plain_send, send_rows
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


def test_the_plain_way_sends_bytes() -> None:
    data = bytes(range(256)) * 9
    for camera in ((250, 250), (100, 120)):
        assert plain_send(data, 6, (240, 240), camera, 4) == data
    one_short = plain_send(data, 6, (240, 240), (50, 250), 4)  # rows between the cells
    assert one_short != data


@pytest.mark.slow
def test_rows_of_a_link(device: Device) -> None:
    keys = {
        "panel.width": 160, "panel.height": 160, "modem.cell": 2, "modem.ticks": 2,
        "modem.rate": 0.75, "sensor.chip": "spikeone", "sensor.width": 200, "sensor.height": 200,
    }  # fmt: skip
    setup, first, later = send_rows(device, 200, **keys)
    assert setup.name == "core.send-setup" and setup.unit == "s" and setup.value > 0
    for row, which in ((first, "first call"), (later, "later calls")):
        assert row.name == "core.send" and row.unit == "bit/s" and row.tier == f"fast, {which}"
        assert row.value > 0 and row.plain_ratio is not None and row.realtime is not None
    assert later.value > first.value
