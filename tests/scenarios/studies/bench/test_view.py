"""The benchmark of `viform view`, with a small stream."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenarios.studies.bench.view as bench
from cosim.files.zarr_store import ZarrStream
from cosim.run.timing import BRIGHT, DARK

SHAPE, CYCLES = (30, 40), 4_000


@pytest.fixture
def stream(tmp_path: Path) -> Path:
    bench.write_stream(tmp_path / "a.zarr", SHAPE, CYCLES)
    return tmp_path / "a.zarr"


def test_the_stream_has_the_rates_it_states(stream: Path) -> None:
    """The drawn blocks hold 30 x 512 Bernoulli draws a column: within five standard errors."""
    read = ZarrStream(stream)
    assert read.cycles == CYCLES and read.shape == SHAPE
    words = read.read_words(0, 16)
    found = np.bitwise_count(words).sum(axis=(0, 1)) / (16 * 32 * SHAPE[0])
    rates = np.rint(np.linspace(DARK, BRIGHT, SHAPE[1]) * 256) / 256
    error = np.sqrt(rates * (1 - rates) / (16 * 32 * SHAPE[0]))
    assert (np.abs(found - rates) < 5 * error).all()


def test_rows_are_measured_by_asking_the_command(stream: Path, monkeypatch) -> None:
    monkeypatch.setattr(bench, "_STEPS", 3)
    monkeypatch.setattr(bench, "_PAUSE_S", 0.0)
    found = bench._measure(stream, CYCLES)
    kinds = [f"{what}-{method}" for method in ("tfp", "tfi") for what in ("step", "chunk", "jump")]
    assert list(found) == ["start", "first-picture", *kinds, "memory"]
    assert min(found.values()) > 0
    assert found["memory"] > 20e6  # an interpreter with numpy


def test_a_refused_request_is_not_a_measurement(stream: Path) -> None:
    with bench._viewing(stream) as viewer:
        while b"data-kind='stream'" not in viewer.ask("")[1]:
            pass
        with pytest.raises(RuntimeError, match="answers 400: at must be"):
            viewer.picture(CYCLES)
