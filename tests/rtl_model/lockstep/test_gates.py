"""Lockstep of the cycle model with the netlist that yosys maps to an ice40, so that the synthesis
is compared and not only the source."""

import shutil

import pytest

from rtl_model import lockstep
from rtl_model.verilated import VERILOG
from tests.rtl_model.netlist import NEEDS_TOOLS, netlist

pytestmark = [pytest.mark.slow, *NEEDS_TOOLS]

PROGRAM = lockstep.Program(rows=4, columns=40, lanes=32, seed=1)  # its second tile is partly filled
PIXELS = 3e5
TOP, PARAMETERS = "viform_system", PROGRAM.geometry.verilog


def test_the_netlist_is_the_model(tmp_path):
    sources = netlist(VERILOG, tmp_path / "gates", TOP, PARAMETERS)
    outcome = lockstep.run(PROGRAM, pixels=PIXELS, sources=sources)
    assert outcome.difference is None, str(outcome.difference)
    assert outcome.pixels >= PIXELS
    coverage = outcome.coverage
    assert (
        min(coverage.spikes, coverage.reads, coverage.writes, coverage.sink_tiles, coverage.bursts)
        > 0
    )


def test_a_fault_in_the_source_is_caught_in_the_netlist(tmp_path):
    copy = tmp_path / "verilog"
    shutil.copytree(VERILOG, copy)
    path = copy / "viform_pixels.v"
    good, bad = "reset_rule == 2'd2 || below", "reset_rule == 2'd2"
    assert path.read_text().count(good) == 1, "the Verilog has changed"
    path.write_text(path.read_text().replace(good, bad))
    gates = netlist(copy, tmp_path / "gates", TOP, PARAMETERS)
    found = lockstep.run(PROGRAM, pixels=PIXELS, sources=gates)
    assert found.difference is not None, "not caught"
    assert found.difference.what == "spike"
