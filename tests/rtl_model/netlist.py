"""Netlists of ice40 cells by yosys, for comparisons of the synthesis and not only of the source,
and Verilator's remarks on a source."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rtl_model.verilated import VERILOG
from rtl_model.verilated.build import missing


def lint(top, settings=(), *, folder=VERILOG, options=("-I.",)):
    """The ended process of Verilator, which remarks on a module. It works in the folder of the
    sources: it takes a blank in a name for the end of the name."""
    command = ["verilator", "--lint-only", "-Wall", *options, "--top-module", top]
    command += [f"-G{name}={value}" for name, value in dict(settings).items()]
    return subprocess.run(
        [*command, f"{top}.v"], cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )


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
NEEDS_TOOLS = [
    pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}"),
    pytest.mark.skipif(MODELS is None, reason="needs yosys and its models of the ice40's cells"),
]


def netlist(sources, folder, top, parameters):
    """A folder with the module `top` as a netlist, and the models of its cells.

    sources: folder of the Verilog. parameters: by name; those that the module has are set.
    """
    folder.mkdir(exist_ok=True)
    (folder / "sources").symlink_to(sources.resolve())
    names = " ".join(f"sources/{path.name}" for path in sorted(sources.glob("*.v")))
    settings = "".join(
        f" -set {name} {value}"
        for name, value in parameters.items()
        if f"] {name} =" in (sources / f"{top}.v").read_text()
    )
    made = folder / f"{top}.v"
    script = (
        f"read_verilog -Isources {names}; chparam{settings} {top}; "
        f"synth_ice40 -top {top}; write_verilog -noattr {made.name}"
    )
    subprocess.run(
        ["yosys", "-q", "-p", script], cwd=folder, capture_output=True, timeout=1800, check=True
    )
    text = made.read_text()
    described = MODELS.read_text()
    used = [
        found[0]
        for found in re.finditer(r"^module (\w+)\b.*?^endmodule$", described, re.M | re.S)
        if f"  {found[1]} " in text
    ]
    assert len(used) > 5  # look-up table, carry, block RAM, several kinds of flip-flops
    assert "SB_LUT4" in text
    head = described[: re.search(r"^module ", described, re.M).start()]
    # Verilator 5.006 knows no default values of ports; all that matter are connected.
    made.write_text("\n".join([text, "`define NO_ICE40_DEFAULT_ASSIGNMENTS", head, *used, ""]))
    return folder
