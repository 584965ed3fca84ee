"""The Verilog of each source with its stream agrees with the cycle model in every bit and clock."""

import shutil

import numpy as np
import pytest

from rtl_model.stream.lockstep import COLUMNS, beats, run
from rtl_model.stream.program import Case
from rtl_model.verilated.build import missing
from tests.rtl_model.netlist import lint
from tests.rtl_model.stream.reader import read_stream

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")

LINES = Case("lines", clocks=30_000)
EXTERNAL = Case("external", rows=4, pixels=8, depth=8)
ARRAY = Case("array", clocks=60_000)
MORE = [
    Case("lines", rows=3, columns=100, lanes=64, depth=4, seed=5, clocks=60_000),
    Case("lines", rows=2, columns=300, depth=64, seed=6, clocks=60_000),
    Case("lines", rows=300, columns=32, depth=256, seed=7, clocks=100_000),
    Case("external", rows=3, columns=70, lanes=64, pixels=1, seed=2, latency=1, depth=4),
    Case("external", columns=33, pixels=2, in_flight=2, seed=3, latency=20, clocks=60_000),
    Case("external", rows=20, columns=64, pixels=8, in_flight=32, seed=4, clocks=60_000),
    Case("external", rows=128, columns=128, pixels=8, depth=512, seed=8, clocks=60_000),
    ARRAY,
    Case("array", rows=3, columns=100, lanes=64, depth=4, seed=9, clocks=60_000),
    Case("array", rows=4, columns=32, depth=64, seed=10, clocks=60_000),
]


def column(case, outcome, name):
    return outcome.outputs[:, COLUMNS[case.source].index(name)].astype(np.int64)


def protocol_errors(case, outputs):
    """Clocks at which an offer that was not taken has changed (AXI4-Stream, 2.2.1)."""
    ready, valid = case.inputs[:-1, 0] == 1, outputs[:-1, 0] == 1
    waits = valid & ~ready
    return np.flatnonzero(waits & (outputs[1:, :4] != outputs[:-1, :4]).any(axis=1))


def checked(case):
    """The outcome of a run whose outputs are equal and have met every case of the stream."""
    outcome = run(case)
    assert outcome.difference is None, outcome.difference
    assert outcome.clocks == len(case.inputs) >= case.clocks
    if case.source == "array":  # a soft reset empties the ring, whatever waits
        assert len(protocol_errors(case, outcome.outputs)) <= 30
    else:
        assert not len(protocol_errors(case, outcome.outputs))
    return outcome


def meets_everything(case, outcome):
    offered, user = column(case, outcome, "valid"), column(case, outcome, "user")
    ready = case.inputs[:, 0].astype(np.int64)
    assert min((offered & ready).sum(), (offered & ~ready & 1).sum(), (~offered & ready).sum()) > 99
    assert set(user[offered & ready == 1]) == {0, 1, 3}
    assert column(case, outcome, "lost_planes").max() > 3
    assert column(case, outcome, "lost_rows").max() > column(case, outcome, "lost_planes").max()


def test_a_sensors_lanes():
    outcome = checked(LINES)
    meets_everything(LINES, outcome)
    for name in ("losses", "bad_rows", "missed_rows"):
        assert column(LINES, outcome, name).max() > 10
    found = read_stream(beats(LINES, outcome.outputs), LINES.geometry)
    assert len(found.planes) > 20
    assert found.incomplete and found.missing


def test_pixels_in_an_external_memory():
    outcome = checked(EXTERNAL)
    meets_everything(EXTERNAL, outcome)
    assert column(EXTERNAL, outcome, "frames").max() > 10
    assert column(EXTERNAL, outcome, "late").max() > 3
    command, write = column(EXTERNAL, outcome, "command"), column(EXTERNAL, outcome, "write")
    waits = (command == 1) & (EXTERNAL.inputs[:, 1] == 0)
    assert min((write == 1).sum(), waits.sum()) > 1000


@pytest.mark.slow
@pytest.mark.parametrize("case", MORE, ids=lambda case: f"{case.source}-{case.seed}")
def test_more_builds(case):
    outcome = checked(case)
    if case is ARRAY:
        meets_everything(case, outcome)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 110))
@pytest.mark.parametrize("case", [LINES, EXTERNAL, ARRAY], ids=lambda case: case.source)
def test_many_seeds(case, seed):
    checked(Case(case.source, case.rows, seed=seed, clocks=200_000, latency=1 + seed % 17))


@pytest.mark.skipif(shutil.which("verilator") is None, reason="needs the system package verilator")
@pytest.mark.parametrize(
    ("source", "settings"),
    [
        ("array", {"LANES": 64, "COLUMNS": 70, "DEPTH": 4}),
        ("external", {"ROWS": 1000, "COLUMNS": 1000, "PIXELS": 8}),
        ("external", {"ROWS": 3, "COLUMNS": 40, "LANES": 64, "PIXELS": 1}),
        ("lines", {"ROWS": 1000, "COLUMNS": 1000, "LANES": 64}),
        ("lines", {}),
    ],
)
def test_verilator_has_nothing_to_remark(source, settings):
    said = lint(f"viform_stream_{source}", settings)
    assert (said.returncode, said.stdout + said.stderr) == (0, "")


@pytest.mark.parametrize(
    ("source", "name", "value"),
    [("lines", "DEPTH", 48), ("array", "DEPTH", 1), ("external", "PIXELS", 3),
     ("external", "IN_FLIGHT", 12)],
)  # fmt: skip
def test_a_parameter_that_is_not_supported_is_refused(source, name, value):
    said = lint(f"viform_stream_{source}", {name: value})
    assert said.returncode != 0
    assert f"{name}_must_be_" in said.stdout + said.stderr
