"""bench link: its rows as programs read them, and that what is timed is received."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

import scenarios.studies.bench.detector
import scenarios.studies.bench.ldpc
import scenarios.studies.bench.link
import scenarios.studies.bench.sensor


def test_bench_link_prints_the_documented_rows(
    monkeypatch: pytest.MonkeyPatch, viform: Callable[..., Any]
) -> None:
    monkeypatch.setattr(scenarios.studies.bench.link, "SIZES", (128, 160))
    monkeypatch.setattr(scenarios.studies.bench.link, "TURNS", 1)
    monkeypatch.setattr(scenarios.studies.bench.ldpc, "TURNS", 1)
    monkeypatch.setattr(scenarios.studies.bench.ldpc, "WORDS", 16)
    monkeypatch.setattr(scenarios.studies.bench.detector, "HEIGHT", 128)
    monkeypatch.setattr(scenarios.studies.bench.detector, "PHASES", (0.25,))
    monkeypatch.setattr(scenarios.studies.bench.sensor, "CYCLES", 64)
    answer = viform("bench", "link", "--json")
    assert answer.code == 0, answer.err
    rows = json.loads(answer.out)["rows"]
    assert [row["name"] for row in rows] == (
        ["link.modem"] * 2 + ["link.detector"] * 6 + ["link.ldpc"] * 8
    )
    for row in rows[:2]:
        assert row["tier"].startswith("joint, ") and row["tier"].endswith(" cells")
        assert row["unit"] == "bit/s"
        assert min(row["value"], row["plain_ratio"], row["realtime"]) > 0
    joint, packed = rows[2:4]
    assert (joint["tier"], joint["plain_ratio"], packed["tier"]) == ("joint", 1, "packed")
    assert joint["unit"] == packed["unit"] == "ns/cell-symbol"
    assert packed["plain_ratio"] > 2
    for joint, packed in (rows[4:6], rows[6:8]):
        assert joint["unit"] == packed["unit"] == "bit"
        assert joint["tier"].removeprefix("joint") == packed["tier"].removeprefix("packed")
        assert packed["value"] > joint["value"] - 0.005
    codes = rows[8:]
    for row in codes:
        assert row["unit"] == "bit/s" and min(row["value"], row["realtime"]) > 0
    assert [row["tier"] for row in codes[::2]] == [
        "encode", "decode, rate 0.917", "decode, rate 0.880", "decode, rate 0.815"
    ]  # fmt: skip
    assert all(row["tier"].endswith(", a core") for row in codes[1::2])


def test_what_is_timed_is_received() -> None:
    _, bits, _, calls, _ = scenarios.studies.bench.link._modem(128)
    assert bits > 0
    for call in calls:
        right = call()
        assert right > 0 and right == call()
