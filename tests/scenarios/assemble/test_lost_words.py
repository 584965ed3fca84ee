"""Words and frames of LDPC modes fail as often as a run says that they should."""

import time
from pathlib import Path

import pytest

from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from scenarios.assemble.schema.loading import load
from scenarios.run import run_scenario

SMALL = (
    "sensor.chip=spikeone", "link.panel.width=384", "link.panel.height=224", "link.size=600000",
    "link.modem.cell=2", "link.modem.ticks=1", "link.modem.line=scrambled",
    "link.panel.clock_offset=0", "sensor.clock_steering=false",
)  # fmt: skip
"""Symbols of one phase, on 384 x 224 panel pixels before 400 x 250 camera pixels."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("phase", "rate"), [(0.56, 0.84), (0.53, 0.88), (0.48, 0.91), (0.43, 0.935)]
)
def test_as_many_fail_as_expected(phase: float, rate: float, tmp_path: Path) -> None:
    """At the edge of each code: 6, 53, 8 and 11 % of 620 to 650 words failed."""
    name, scenario = load(
        "light-link", [*SMALL, f"link.panel.phase={phase}", f"link.modem.rate={rate}"]
    )
    done = run_scenario(
        name, scenario, tmp_path / "run", options=Options(), progress=SilentProgress(),
        began=time.perf_counter(), report=lambda machine, run: [],
    )  # fmt: skip
    metric = {key: each.value for key, each in done.result.metrics.items()}
    lost = metric["words_lost"] / metric["words"]
    assert 0.01 < lost < 0.6
    assert metric["words_theory_low"] <= lost <= metric["words_theory_high"]
    assert metric["fer_theory_low"] <= metric["fer"] <= metric["fer_theory_high"]
    assert metric["words_theory_high"] - metric["words_theory_low"] < 0.75
    assert metric["words_theory_low"] < metric["words_theory"] < metric["words_theory_high"]
