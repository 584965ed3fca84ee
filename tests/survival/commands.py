"""A small run of every kind, for attacks that repeat it many times."""

from __future__ import annotations

from typing import Any

from cosim.run import chain
from tests.recorded.cases import LINK, SMALL


def _sets(*assignments: str) -> tuple[str, ...]:
    return tuple(word for each in assignments for word in ("--set", each))


RUNS: dict[str, tuple[str, ...]] = {
    "latched": ("film", *SMALL, *_sets("duration=4 ms")),
    "display": ("glass", *SMALL, *_sets(
        "duration=3 ms", "image.at=[60]", "display.beside=[]",
    )),
    "asynchronous": ("film", *SMALL, *_sets("sensor.pixel=asynchronous", "duration=2 ms")),
    "continuous": ("film", *SMALL, *_sets("sensor.pixel=continuous", "duration=2 ms")),
    "link": ("light-link", *LINK),
    "carried": ("glass-over-light", *_sets(
        "sensor.width=96", "sensor.height=64", "duration=8 ms", "image.at=[160]",
        "link.panel.width=192", "link.panel.height=192", "link.sensor.chip=spikeone",
        "code.cycles=64", "code.tile=32", "display.beside=[]", "display.projector=none",
    )),
    "emccd": ("emccd-window", *_sets("duration=120 ms")),
    "ebaps": ("ebaps-night", *_sets("duration=200 ms", "imager.rows=64", "imager.columns=80")),
    "adaptive": ("adaptive-exposure", *_sets("duration=60 ms")),
}  # fmt: skip
"""Scenario and settings by kind of machine."""


def often() -> None:
    """Has a checkpoint written after every block of a chain: these runs end before the first one
    that is due, so a kill would only ever begin them anew."""
    run_blocks = chain.run_blocks

    def after_each(*args: Any, **given: Any) -> dict[str, float]:
        return run_blocks(*args, **given | {"every_s": -1.0})

    chain.run_blocks = after_each
