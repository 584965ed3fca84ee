"""Long files over the shipped link: what the locked clock, soft words and short symbols carry."""

from __future__ import annotations

from pathlib import Path

import pytest

import viform


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "steered", "least"),
    [(8_000_000, "true", 5.5e9), (64_000_000, "true", 8e9), (64_000_000, "false", 6e9)],
)
def test_goodput_of_long_files(tmp_path: Path, size: int, steered: str, least: float) -> None:
    """From a phase of .37, with clocks 20 ppm apart."""
    done = viform.run(
        "light-link", out=tmp_path / "run",
        **{"link.size": size, "link.panel.phase": 0.37, "sensor.clock_steering": steered},
    )  # fmt: skip
    assert done.outcome == "ok"  # whole: the CRC of the file is right
    goodput, phase = done.metrics["goodput_bps"], done.metrics["phase_error_most"]
    assert goodput is not None and goodput >= least
    assert (phase is not None) == (steered == "true") and (phase or 0) < 0.1
