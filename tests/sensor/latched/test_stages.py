"""Duplicated rows of a readout: the stage, the key, and a run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import zarr

from cosim import Block, Clock, InputError
from cosim.spikes.viform import Viform
from scenarios.assemble.schema.loading import load
from scenarios.cli.entry import _main
from sensor.latched.stages import readout_stages

RUN = ("sensor.chip=spikeone", "duration=1 ms", "image.at=[20]", "image.window=9", "tolerance=0.1")


def test_rows_show_the_bits_of_others() -> None:
    words = np.random.default_rng(1).integers(0, 2**32, (2, 6, 5), dtype=np.uint32)
    given = Viform(words, 64, Clock(40_000), 128)
    (stage,) = readout_stages([(0, 2), (1, 5)]).values()
    shown = stage.step(given, Block(128, 64))
    np.testing.assert_array_equal(shown.words, words[:, [0, 1, 0, 3, 4, 1]])
    assert (shown.start, shown.cycles) == (128, 64) and readout_stages(()) == {}


def test_the_preset_of_spikeone_duplicates_two_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [word for each in (*RUN, "sensor.preset=silicon") for word in ("--set", each)]
    assert _main(["run", "film", *words, "--json", "--out", str(tmp_path / "run")]) == 0
    assert json.loads(capsys.readouterr().out)["error"]["tiles_over"] == 0
    rows = zarr.open_group(str(tmp_path / "run" / "stream.zarr"), mode="r")["words"][:, :6]
    assert (rows[:, 2] == rows[:, 0]).all() and (rows[:, 3] == rows[:, 1]).all()
    assert not (rows[:, 4] == rows[:, 0]).all() and not (rows[:, 5] == rows[:, 1]).all()


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (["sensor.duplicated_rows=[[0, 250]]"], "rows from 0 to 249"),
        (["sensor.duplicated_rows=[[0, 2], [1, 2]]"], "whose targets differ"),
        (["sensor.duplicated_rows=[[0, 2], [2, 3]]"], "are no sources"),
        (["sensor.duplicated_rows=[[0, 2]]", "sensor.pixel=asynchronous"], "latched pixels"),
    ],
)
def test_pairs_that_no_readout_has_are_refused(sets: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        load("film", ["sensor.chip=spikeone", *sets])
