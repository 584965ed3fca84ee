"""bench link: its rows as programs read them, and that what is timed is received."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

import scenarios.studies.bench.modem as modem
from tests.scenarios.studies.bench.small import make_bench_small


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small panel before a small camera, and few words."""
    make_bench_small(monkeypatch, "link")


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_bench_link_prints_the_documented_rows(viform: Callable[..., Any]) -> None:
    answer = viform("bench", "link", "--json")
    assert answer.code == 0, answer.err
    rows = json.loads(answer.out)["rows"]
    assert [row["name"] for row in rows] == (
        ["link.modem"] * 4 + ["link.acquisition"] * 2 + ["link.detector"] * 6 + ["link.ldpc"] * 8
        + ["link.reed-solomon"] * 8
    )  # fmt: skip
    kinds = "receive", "receive, a core", "receive with acquisition", "send"
    for row, what in zip(rows, kinds, strict=False):
        assert row["tier"].rpartition(",")[0] == what and row["tier"].endswith(" cells")
        assert row["unit"] == "bit/s" and min(row["value"], row["realtime"]) > 0
    assert rows[0]["plain_ratio"] > 1 and rows[0]["value"] > rows[2]["value"]
    assert all(row["unit"] == "s" and row["value"] > 0 for row in rows[4:6])
    joint, packed = rows[6:8]
    assert (joint["tier"], joint["plain_ratio"], packed["tier"]) == ("joint", 1, "packed")
    assert joint["unit"] == packed["unit"] == "ns/cell-symbol"
    assert packed["plain_ratio"] > 1
    for joint, packed in (rows[8:10], rows[10:12]):
        assert joint["unit"] == packed["unit"] == "bit"
        assert joint["tier"].removeprefix("joint") == packed["tier"].removeprefix("packed")
        assert packed["value"] > joint["value"] - 0.002
    codes = rows[12:]
    for row in codes:
        assert row["unit"] == "bit/s" and min(row["value"], row["realtime"]) > 0
    assert [row["tier"] for row in codes[::2]] == [
        "encode", "decode, rate 0.917", "decode, rate 0.880", "decode, rate 0.815", "encode",
        *(f"decode, {wrong} of 255 bytes wrong" for wrong in (0, 4, 16)),
    ]  # fmt: skip
    assert all(row["tier"].endswith(", a core") for row in codes[1::2])


@pytest.mark.usefixtures("small")
def test_what_is_timed_is_received_and_a_lost_file_ends_the_benchmark() -> None:
    filmed = modem.film_link(None)
    assert min(modem.receive(filmed, None)) > 0
    filmed.words[2:] = 0  # dark from tick 64 on
    with pytest.raises(RuntimeError, match="did not arrive"):
        modem.receive(filmed, None)
