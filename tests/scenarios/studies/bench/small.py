"""Sizes at which the parts of `viform bench` take seconds, by the names of what they replace."""

from __future__ import annotations

from typing import Any, Final

import pytest

import scenarios.studies.bench.display as loop
import scenarios.studies.bench.modem as modem
from rtl_model.events.encoder import EventSize
from sensor import CHIPS

_GLASS = "sensor.width=32", "sensor.height=24", "display.beside=[]", "display.projector=none"
_LOOPS: Final = {
    "loop.glass": (*loop.LOOPS["loop.glass"][:1], *_GLASS),
    "loop.glass-over-light": (
        *loop.LOOPS["loop.glass-over-light"][:1], *_GLASS, "link.panel.width=192",
        "link.panel.height=192", "link.sensor.chip=spikeone", "code.cycles=32", "code.tile=8",
    ),
}  # fmt: skip
SMALL_BENCH: Final[dict[str, dict[str, Any]]] = {
    "sensor": {
        "bench.sensor.CYCLES": 64, "bench.sensor.PLAIN_CYCLES": 1, "bench.sensor.REPEATS": 1,
        "bench.sensor.SHORT": 1, "bench.sensor.BLOCK": 8,
    },
    "core": {
        "bench.core.CHIP": (24, 40), "bench.core.LARGE": (20, 32), "bench.core.FRAMES": 6,
        "bench.core.CHIPS": {(24, 40): "spikeone", (20, 32): "spiketwo"},
        "bench.core.LARGE_FRAMES": 4, "bench.sensor.CYCLES": 64,
        "bench.core.send_rows": lambda device, size: [],  # it has a test of its own
    },
    "display": {
        "bench.display.CHIPS": {"spiketwo": CHIPS["spikeone"]}, "bench.display.CYCLES": 128,
        "bench.display.PLAIN_CYCLES": 2, "bench.display.REPEATS": 1, "bench.sensor.CYCLES": 64,
    },
    "link": {
        "bench.modem.SETS": (
            *modem.SETS, "link.panel.width=256", "link.panel.height=256", "sensor.width=320",
            "sensor.height=320",
        ),
        "bench.modem.BYTES": 20_000, "bench.modem.TURNS": 1, "bench.link.LDPC_TURNS": 1,
        "bench.link.RS_TURNS": 1,
        "bench.link.LDPC_WORDS": 16, "bench.link.RS_WORDS": 16, "bench.link.HEIGHT": 128,
        "bench.link.PHASES": (0.25,), "bench.sensor.CYCLES": 64,
    },
    "loop": {"bench.display.LOOPS": _LOOPS, "bench.display.DURATION": loop.WARM},
    "board": {"bench.board.SECONDS": 0.1},
    "code": {
        "codes.measure.SHAPE": (24, 32), "codes.measure.CYCLES": 640,
        "codes.measure.SCENES": {"step": "still", "pan": "moving"},
        "codes.measure.THRESHOLDS": (100.0,), "codes.measure.INSTANTS": (320,),
        "codes.measure.MEANS": (20.3,), "codes.measure.STEADY_PIXELS": 100,
    },
    "events": {
        "events.SIZES": (EventSize(8, 8, depth=64),), "events.RATES": (0.01, 0.3),
    },
}  # fmt: skip
"""By part: names below `scenarios.studies`, and their values."""


def make_bench_small(monkeypatch: pytest.MonkeyPatch, *parts: str) -> None:
    """Sets the sizes of these parts."""
    for part in parts:
        for name, value in SMALL_BENCH[part].items():
            monkeypatch.setattr(f"scenarios.studies.{name}", value)
