"""The layered code on the streams of the shipped scenarios."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from cosim.files import ZarrStream
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from cosim.spikes.viform import words_for
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.loading import load, shipped
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.machine import LatchedMachine
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import from_packets, to_packets


def filmed() -> list[str]:
    """Shipped scenarios that film a scene with a latched chip."""
    found = []
    for name in sorted(shipped()):
        _, scenario = load(name)
        if isinstance(scenario, Scenario) and scenario.sensor.pixel == "latched":
            found.append(name)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", filmed())
@pytest.mark.parametrize("cycles", [128, 512])
def test_the_stream_of_a_shipped_scenario_comes_back(
    name: str, cycles: int, tmp_path: Path
) -> None:
    small = ["sensor.width=160", "sensor.height=120", "duration=16 ms", "image.at=[160]"]
    _, scenario = load(name, small)
    scenario = scenario.model_copy(update={"link": None, "display": None, "code": None})
    machine = assemble(name, scenario, Options("numba"), SilentProgress())
    assert isinstance(machine, LatchedMachine)
    with closing(machine):
        machine.chain(tmp_path).run(SilentProgress())
    stream, code = ZarrStream(tmp_path / "stream.zarr"), StreamCode(cycles=cycles)
    words = stream.read_words(0, words_for(stream.cycles))
    assert words.any()
    again = from_packets(to_packets(stream, code), stream, code)
    np.testing.assert_array_equal(again.words, words)
