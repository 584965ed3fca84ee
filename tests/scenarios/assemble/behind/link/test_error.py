"""The error of the display behind a code that leaves layers out."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.source.latched.feed import LatchedFeed
from scenarios.run import run_scenario


@pytest.fixture(autouse=True)
def _no_minute_of_light(monkeypatch: pytest.MonkeyPatch) -> None:
    """PstLM takes this chip minutes, and has a test of its own."""
    monkeypatch.setattr(LatchedFeed, "pst_lm", False)


def run(folder: Path, rate: str | None, tolerance: float) -> dict[str, Any]:
    code: dict[str, Any] = {"cycles": 128, "tile": 32, "buffer": "3.2 ms"}
    scenario = validate({
        "title": "a code", "duration": "6 ms", "image": {"at": [160]}, "tolerance": tolerance,
        "scene": {"kind": "film", "drawn": "chart", "illuminance": "700 lux"},
        "sensor": {"width": 96, "height": 64, "threshold": "1000 e", "preset": "silicon"},
        "code": code if rate is None else code | {"rate": rate},
        "link": {
            "panel": {"width": 192, "height": 192},
            "modem": {"cell": 2, "ticks": 2, "line": "8b10b", "parity": 16},
            "sensor": {"chip": "spikeone", "threshold": "1000 e", "reset": "hard"},
        },
        "display": {"drive": "causal", "renderer": "numpy", "beside": [], "projector": "none"},
    })  # fmt: skip
    done = run_scenario(
        "code", scenario, folder, options=Options(), progress=SilentProgress(),
        began=time.perf_counter(), report=lambda machine, run: [],
    )  # fmt: skip
    document: dict[str, Any] = done.result.document()
    return document


@pytest.mark.slow
def test_the_error_behind_a_code_is_that_before_it_or_larger(tmp_path: Path) -> None:
    whole = run(tmp_path / "whole", None, 0.01)
    assert whole["metrics"]["packets_dropped"]["value"] == 0
    assert "behind a code" not in whole["error"]["kind"]
    cut = run(tmp_path / "cut", "2 Mbit/s", 0.01)
    assert cut["metrics"]["packets_dropped"]["value"] > 0
    assert cut["error"]["kind"].endswith("behind a code that left layers out")
    assert cut["error"]["value"] >= whole["error"]["value"]
    assert cut["error"]["ci"][1] > whole["error"]["ci"][1]


@pytest.mark.slow
def test_with_full_physics_nothing_is_wrong_behind_the_code_either(tmp_path: Path) -> None:
    done = run(tmp_path / "run", "2 Mbit/s", 0.0)
    assert done["error"]["value"] < 1e-3
