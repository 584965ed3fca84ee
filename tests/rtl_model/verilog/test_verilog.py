"""The Verilog agrees with the register table, and Verilator accepts it without a warning."""

import runpy
import shutil
import subprocess
import sys

import pytest

from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS
from rtl_model.registers.verilog import HEADER, verilog_header
from rtl_model.verilated import VERILOG
from tests.rtl_model.netlist import lint


def test_the_header_is_made_from_the_table(capsys, monkeypatch):
    assert HEADER.read_text(encoding="utf-8") == verilog_header()
    monkeypatch.delitem(sys.modules, "rtl_model.registers.verilog")
    runpy.run_module("rtl_model.registers.verilog", run_name="__main__")
    assert capsys.readouterr().out == verilog_header()


def test_every_register_stands_in_a_module():
    """A name that occurs only in the header is a missing register."""
    text = "".join(path.read_text(encoding="utf-8") for path in VERILOG.glob("*.v"))
    # These answer by not being the others: they read 0 and keep nothing.
    missing = [r.name for r in REGISTERS if f"`VIFORM_{r.name.upper()}:" not in text]
    assert set(missing) == {
        "ctrl_reset", "uart_clear", "prbs_check", "capture_arm", "capture_data", "sink_data",
        "sink_run", "sink_clear",
    }  # fmt: skip
    assert [name for name in missing if f"`VIFORM_{name.upper()}" not in text] == []


def test_nothing_is_waived():
    for path in sorted(VERILOG.iterdir()):
        text = path.read_text(encoding="utf-8")
        assert "lint_off" not in text
        assert text.count("\n") < 400
        assert max(map(len, text.splitlines())) <= 100, path.name


@pytest.mark.skipif(shutil.which("verilator") is None, reason="needs the system package verilator")
@pytest.mark.parametrize(
    "geometry",
    [
        Geometry(),
        Geometry(rows=1, columns=1, clock_hz=1_000_000),
        Geometry(rows=7, columns=200, lanes=64, capture_words=64, sink_words=16),
        Geometry(rows=1000, columns=1000, lanes=64),
    ],
)
def test_verilator_has_nothing_to_remark(geometry):
    done = lint("viform_board", geometry.verilog)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


REFUSED = [
    ("LANES", 48), ("LANES", 128), ("CAPTURE_WORDS", 3000), ("SINK_WORDS", 1000), ("ROWS", 0),
    ("ROWS", 4096), ("COLUMNS", 4097), ("BIT_CLOCKS", 3),
]  # fmt: skip
YOSYS = [("LANES", 48)]
"""For yosys in the ordinary suite, since it elaborates for 8 s before it refuses."""


@pytest.mark.parametrize(
    ("tool", "name", "value"),
    [
        pytest.param(tool, *case, marks=[pytest.mark.slow] if late else [])
        for case in REFUSED
        for tool in ("verilator", "iverilog", "yosys")
        for late in [tool == "yosys" and case not in YOSYS]
    ],
)
def test_a_parameter_that_is_not_supported_is_refused(tool, name, value):
    if shutil.which(tool) is None:
        pytest.skip(f"needs the system package {tool}")
    sources = sorted(path.name for path in VERILOG.glob("*.v"))
    top = "viform_system" if tool == "yosys" and name != "BIT_CLOCKS" else "viform_board"
    script = f"read_verilog -I. {' '.join(sources)}; chparam -set {name} {value} {top}; "
    command = {
        "verilator": ["verilator", "--lint-only", "-Wno-fatal", "-I.", f"-G{name}={value}",
                      "--top-module", top, *sources],
        "iverilog": ["iverilog", "-g2005", "-I.", f"-P{top}.{name}={value}", "-s", top,
                     "-o", "/dev/null", *sources],
        "yosys": ["yosys", "-q", "-p", f"{script}hierarchy -check -top {top}"],
    }[tool]  # fmt: skip
    done = subprocess.run(
        command, cwd=VERILOG, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode != 0
    assert f"{name}_must_be_" in done.stdout + done.stderr
