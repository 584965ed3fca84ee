"""bench display: its rows as programs read them, that it draws what it times, no GL is one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import scenarios.studies.bench.display
import scenarios.studies.bench.sensor
from cosim.run.timing import BRIGHT, DARK, least_of
from cosim.spikes.viform import WORD
from display import probe_gl
from scenarios.studies.bench.display import KINDS, _words
from sensor import CHIPS
from tests.scenarios.studies.bench.small import make_bench_small


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """128 planes of a small panel, each way once."""
    there, said = probe_gl()
    if not there:
        pytest.skip(f"needs GL through EGL: {said}")
    make_bench_small(monkeypatch, "display")


@pytest.mark.usefixtures("small")
def test_bench_display_prints_the_documented_rows(viform: Callable[..., Any]) -> None:
    answer = viform("bench", "display", "--json")
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert list(document) == ["device", "ceiling", "rows"]
    chip = CHIPS["spikeone"]
    for row, kind in zip(document["rows"], KINDS, strict=True):
        assert (row["name"], row["tier"], row["unit"]) == (f"display.{kind}", "exact", "planes/s")
        assert row["value"] > 0 and row["plain_ratio"] > 0
        assert row["realtime"] == pytest.approx(row["value"] / 40e3)
        per_pixel = row["value"] * chip.width * chip.height
        assert row["ceiling_ratio"] == pytest.approx(per_pixel / document["ceiling"]["value"])


@pytest.mark.usefixtures("small")
def test_what_is_timed_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    # A renderer that does nothing would be fast: look at the image of each way.
    seen = []

    def spy(calls: list[Callable[[], Any]], repeats: int) -> list[float]:
        seen.extend(call() for call in calls)
        return least_of(calls, repeats)

    monkeypatch.setattr(scenarios.studies.bench.display, "least_of", spy)
    chip = CHIPS["spikeone"]
    shape = chip.height, chip.width
    words = _words(128, shape)
    rate = np.bitwise_count(words).sum(axis=0) / 128
    for kind in KINDS:
        scenarios.studies.bench.display._planes_a_second(kind, words, shape)
        ours, plain = seen[-2:]
        assert plain.max() > 0
        expected = rate / BRIGHT
        if kind == "pursuit":  # 0.1 pixel a plane, over rows alike: only the sides turn dark
            ours, expected = ours[:, 16:-16], expected[:, 16:-16]
        if kind in ("hold", "causal"):  # dark until the second spike
            assert 0.5 < ours.mean() / expected.mean() < 1.1
        else:
            assert abs(ours.mean() / expected.mean() - 1) < 0.05


def test_the_stream_spikes_at_the_rates_of_the_picture() -> None:
    words = _words(320, (20, 30))
    rate = np.bitwise_count(words).sum(axis=0) / 320
    asked = np.linspace(DARK, BRIGHT, 600).reshape(20, 30)
    assert len(words) == 320 // WORD and np.abs(rate - asked).max() <= 1.001 / 320


def test_without_gl_nothing_is_measured_and_one_line_says_so(
    monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str]
) -> None:
    monkeypatch.setattr(
        scenarios.studies.bench.sensor, "probe_gl", lambda: (False, "the EGL vendor must be")
    )
    monkeypatch.setattr(
        scenarios.studies.bench.sensor, "_ceiling", lambda *a: pytest.fail("measured")
    )
    for arguments in (("bench",), ("bench", "display")):
        line = refused(*arguments)
        assert "GL through EGL" in line and "libegl-mesa0" in line and "bench sensor" in line
