"""Lockstep of the cycle model with the netlist that yosys maps to an ice40, so that the synthesis
is compared and not only the source."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rtl_model import lockstep
from rtl_model.verilated import VERILOG
from rtl_model.verilated.build import missing


def models():
    """The file in which yosys describes the ice40's cells for simulators, or None."""
    yosys, config = shutil.which("yosys"), shutil.which("yosys-config")
    if yosys is None:
        return None
    folders = [Path(yosys).resolve().parents[1] / "share" / "yosys"]
    if config is not None:
        said = subprocess.run([config, "--datdir"], capture_output=True, text=True, check=False)
        folders.insert(0, Path(said.stdout.strip()))
    files = [folder / "ice40" / "cells_sim.v" for folder in folders]
    return next((path for path in files if path.is_file()), None)


MODELS = models()
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}"),
    pytest.mark.skipif(MODELS is None, reason="needs yosys and its models of the ice40's cells"),
]

PROGRAM = lockstep.Program(rows=4, columns=40, lanes=32, seed=1)  # its second tile is partly filled
PIXELS = 3e5


def netlist(sources, folder):
    """A folder with viform_system.v as a netlist, and the models of its cells."""
    return netlist_of("viform_system", PROGRAM.geometry.verilog, sources, folder)


def netlist_of(top, parameters, sources, folder):
    """A folder with the netlist of a module, and the models of its cells.

    `parameters` may hold more than the module has.
    """
    folder.mkdir()
    names = " ".join(path.name for path in sorted(sources.glob("*.v")))
    settings = "".join(
        f" -set {name} {value}"
        for name, value in parameters.items()
        if f"] {name} =" in (sources / f"{top}.v").read_text()
    )
    made = folder / f"{top}.v"
    script = (
        f"read_verilog -I. {names}; chparam{settings} {top}; "
        f"synth_ice40 -top {top}; write_verilog -noattr {made}"
    )
    subprocess.run(
        ["yosys", "-q", "-p", script], cwd=sources, capture_output=True, timeout=1800, check=True
    )
    text = made.read_text()
    described = MODELS.read_text()
    used = [
        found[0]
        for found in re.finditer(r"^module (\w+)\b.*?^endmodule$", described, re.M | re.S)
        if f"  {found[1]} " in text
    ]
    assert len(used) > 5  # look-up table, carry, block RAM, several kinds of flip-flops
    head = described[: re.search(r"^module ", described, re.M).start()]
    # Verilator 5.006 knows no default values of ports; all that matter are connected.
    made.write_text("\n".join([text, "`define NO_ICE40_DEFAULT_ASSIGNMENTS", head, *used, ""]))
    return folder


def test_the_netlist_is_the_model(tmp_path):
    sources = netlist(VERILOG, tmp_path / "gates")
    assert "SB_LUT4" in (sources / "viform_system.v").read_text()
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
    found = lockstep.run(PROGRAM, pixels=PIXELS, sources=netlist(copy, tmp_path / "gates"))
    assert found.difference is not None, "not caught"
    assert found.difference.what == "spike"
