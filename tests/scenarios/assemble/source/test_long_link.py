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


@pytest.mark.slow
def test_a_whole_turn_of_phase_is_received(tmp_path: Path) -> None:
    """Clocks 400 ppm apart, so that 2500 ticks make a turn: each block takes the rate that its
    phase allows. Symbols of two ticks would carry half of the raw bits at the most, and one rate
    for symbols of one tick what it carries at the worst phase."""
    done = viform.run(
        "light-link", out=tmp_path / "run",
        **{
            "link.panel.width": 256, "link.panel.height": 256, "sensor.width": 300,
            "sensor.height": 300, "link.panel.phase": 0.1, "link.panel.clock_offset": 400,
            "sensor.clock_steering": "false", "link.modem.cell": 2, "link.modem.code": "ldpc",
            "link.size": 3_600_000,
        },
    )  # fmt: skip
    assert done.outcome == "ok"
    metrics = done.metrics
    goodput, raw = metrics["goodput_bps"], metrics["raw_bps"]
    assert metrics["ticks"] == 1 and goodput is not None and raw is not None
    assert 8 * 3_600_000 / goodput > 2500 / 40_000  # a turn and more
    assert goodput > 0.68 * raw  # one tick of one rate: at most the information at the worst phase
    assert (metrics["words_lost"] or 0) < 50 and 0.7 < (metrics["code_rate"] or 0) < 0.9
