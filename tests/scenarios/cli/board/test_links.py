"""`viform board links`: shares of a pixel array that links carry."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.scenarios.conftest import Answer


def test_a_share_is_the_links_rate_over_the_arrays(viform: Callable[..., Answer]) -> None:
    answer = viform("board", "links", "--size", "200x100", "--clock", "10 kHz", "--json")
    assert answer.code == 0
    document = json.loads(answer.out)
    assert document["raw_bit_per_s"] == 200e6
    assert document["coded"] == []
    shares = {row["link"]: row["shares"] for row in document["links"]}
    assert shares["UART, 12 Mbaud"] == {"raw": pytest.approx(0.048)}
    assert shares["Ethernet, 1 Gbit/s"] == {"raw": 1.0}
    planes = {row["link"]: row["planes_per_s"] for row in document["links"]}
    assert planes["UART, 12 Mbaud"] == 480.0


def test_codes_are_measured_on_a_recording(viform: Callable[..., Answer], tmp_path: Path) -> None:
    """A pixel that never fires costs the headers of packets, one at random all of its bits."""
    rng = np.random.default_rng(1)
    recordings = {"dark": np.zeros((256, 64, 64), bool), "noise": rng.random((256, 64, 64)) < 0.5}
    bits = {}
    for name, spikes in recordings.items():
        path = tmp_path / f"{name}.npz"
        np.savez(path, spikes=spikes, clock_hz=40_000.0)
        answer = viform("board", "links", path, "--json")
        assert answer.code == 0, answer.err
        document = json.loads(answer.out)
        bits[name] = {row["code"]: row["bits"] for row in document["coded"]}
        share = document["links"][0]["shares"]
        assert share[f"{name}.npz layered"] == pytest.approx(
            min(1, share["raw"] / bits[name]["layered"])
        )
        assert f"| {name}.npz layered |" in viform("board", "links", path).out
    assert max(bits["dark"].values()) < 0.01
    assert bits["noise"]["layered"] > 0.99


def test_what_is_no_size_or_clock_is_refused(refused: Callable[..., str]) -> None:
    assert "--size must be WIDTHxHEIGHT" in refused("board", "links", "--size", "3")
    assert "--clock must be a frequency" in refused("board", "links", "--clock", "fast")
