"""Lockstep of the event path's cycle models with the netlists that yosys maps to an ice40."""

import shutil

import pytest

from rtl_model.events.encoder import EventSize
from rtl_model.verilated import VERILOG
from tests.rtl_model.events.path import Light, run
from tests.rtl_model.netlist import NEEDS_TOOLS, netlist

pytestmark = [pytest.mark.slow, *NEEDS_TOOLS]

SIZE = EventSize(8, 40, 32, 64, 32, tile=70_000)
LIGHT = Light(0.1)


def gates(sources, folder):
    for name in ("encoder", "decoder"):
        netlist(sources, folder, f"viform_event_{name}", SIZE.verilog)
    return folder


def test_the_netlists_are_the_models(tmp_path):
    result = run(SIZE, LIGHT, 1e6, verilog=True, sources=gates(VERILOG, tmp_path / "gates"))
    assert result.failure == ""
    assert result.pixels >= 1e6
    assert min(result.packets, result.gaps, result.lost_spikes) > 10


def test_a_fault_in_the_source_is_caught_in_the_netlist(tmp_path):
    copy = tmp_path / "verilog"
    shutil.copytree(VERILOG, copy)
    path = copy / "viform_event_encoder.v"
    good, bad = "held[6:0] < width", "held[6:0] <= width"
    assert path.read_text().count(good) == 1, "the Verilog has changed"
    path.write_text(path.read_text().replace(good, bad))
    result = run(SIZE, LIGHT, 1e6, verilog=True, sources=gates(copy, tmp_path / "gates"))
    assert result.failure.startswith("word "), result.failure or "not caught"
