"""Stages at the same time and one after another: the same recordings and states, in every shipped
scenario with a chain of blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.run.chain import BlockChain
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from cosim.stage import Stateful
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.loading import load

SMALL = {
    "glass-over-light": ["sensor.width=96", "sensor.height=64", "duration=8 ms", "image.at=[160]",
                         "link.panel.width=192", "link.panel.height=192",
                         "link.sensor.chip=spikeone", "code.cycles=64", "code.tile=32"],
    "light-link": [],
}  # fmt: skip
"""Settings that keep a scenario short; others have the small chip for 10 ms."""
USUAL = ["sensor.chip=spikeone", "duration=10 ms", "image.at=[100]"]


def film(name: str, folder: Path, parallel: bool) -> dict[str, np.ndarray] | None:
    """Runs the chain of a scenario into a folder and returns the states of its stages; None if it
    has no chain of blocks."""
    short, scenario = load(name, SMALL.get(name, USUAL))
    machine = assemble(short, scenario, Options(), SilentProgress())
    try:
        folder.mkdir()
        chain = machine.chain(folder)
        if not isinstance(chain, BlockChain):
            return None
        chain.parallel = parallel
        chain.run(SilentProgress())
        return {
            f"{stage}/{key}": value
            for stage, each in chain.stages.items() if isinstance(each, Stateful)
            for key, value in each.state().items()
            if not key.endswith("took")  # time that cameras of the check have taken
        }  # fmt: skip
    finally:
        machine.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["film", "glass", "glass-over-light", "light-link", "shockwave",
                                  "star", "step", "wave"])  # fmt: skip
def test_the_order_of_the_stages_changes_nothing(name: str, tmp_path: Path) -> None:
    states = [film(name, tmp_path / str(way), way) for way in (True, False)]
    together, alone = states
    assert together is not None and alone is not None and set(together) == set(alone)
    for key, value in together.items():
        assert np.array_equal(value, alone[key], equal_nan=value.dtype.kind == "f"), key
    whole = tmp_path / "True"
    files = {place.relative_to(whole) for place in whole.rglob("*") if place.is_file()}
    assert len(files) > 3
    for file in files:
        assert (whole / file).read_bytes() == (tmp_path / "False" / file).read_bytes()
