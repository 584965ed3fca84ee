"""The top of every target passes three tools without a warning and answers over its pins."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rtl_model.gateware import TARGETS, design_for, fit, target_named
from rtl_model.gateware.top import PORTS, TOP, pins
from rtl_model.registers import MAGIC, REGISTERS, VERSION
from tests.rtl_model.netlist import lint

HERE = Path(__file__).parent
WORDS = next(r.address for r in REGISTERS if r.name == "ctrl_build") // 4 + 1


def needs(program):
    return pytest.mark.skipif(
        shutil.which(program) is None, reason=f"needs the system package {program}"
    )


def written(folder, design):
    """Writes the files of a design."""
    for name, text in design.files().items():
        (folder / name).write_text(text)
    return folder


@needs("verilator")
@pytest.mark.parametrize("name", TARGETS)
def test_verilator_has_nothing_to_remark(name, tmp_path):
    written(tmp_path, design_for(TARGETS[name]))
    (tmp_path / "vendor").symlink_to(HERE)
    done = lint(TOP, folder=tmp_path, options=["-Ivendor"])
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


@needs("verilator")
def test_verilator_has_nothing_to_remark_of_64_lanes(tmp_path):
    written(tmp_path, design_for(target_named("ulx3s-85f"), rows=64, columns=100, lanes=64))
    done = lint(TOP, folder=tmp_path, options=())
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def read_over_the_line(folder, design):
    """What Icarus prints: the first words of the board, by the top's pins alone."""
    written(folder, design)
    settings = {
        "HALF_PS": 10**12 // (2 * design.target.pin_hz),
        "BIT_PS": 10**12 // design.geometry.baud,
        "WORDS": WORDS,
    }
    sources = sorted(str(path) for path in (*folder.glob("*.v"), HERE / "line.v", HERE / "BUFG.v"))
    command = ["iverilog", "-g2005", "-Wall", "-Wno-timescale", "-I", str(folder), "-s", "line"]
    command += [*(f"-D{name}={value}" for name, value in settings.items()), "-o", "line.vvp"]
    built = subprocess.run(
        [*command, *sources], cwd=folder, capture_output=True, text=True, timeout=120, check=False
    )
    assert (built.returncode, built.stderr) == (0, "")
    run = subprocess.run(
        ["vvp", "-n", "line.vvp"],
        cwd=folder, capture_output=True, text=True, timeout=900, check=True,
    )  # fmt: skip
    return run.stdout.splitlines()


def check_answer(lines, design):
    sent = "".join(line.split()[1] for line in lines if line.startswith("byte "))
    words = [int(sent[8 * n : 8 * n + 8], 16) for n in range(len(sent) // 8)]
    assert [line for line in lines if not line.startswith("byte ")] == [f"done {4 * WORDS}"]
    names = [r.name for r in sorted(REGISTERS, key=lambda r: r.address)]
    told = dict(zip(names[:WORDS], words, strict=True))
    assert told["ctrl_magic"] == MAGIC == 0x53504B32
    assert told["ctrl_version"] == VERSION
    assert told["ctrl_build"] == design.build
    assert told["ctrl_clock_hz"] == design.target.clock_hz


@needs("iverilog")
@pytest.mark.parametrize("name", ["ulx3s-25f", "arty-a7-35"])
def test_the_magic_is_read_over_the_pins(name, tmp_path):
    """At a high baud, which makes it quick: an undivided clock, and a divided one."""
    design = design_for(TARGETS[name], rows=2, baud=2_500_000)
    check_answer(read_over_the_line(tmp_path, design), design)


@needs("iverilog")
@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_the_magic_is_read_over_the_pins_as_made(name, tmp_path):
    design = design_for(TARGETS[name])
    check_answer(read_over_the_line(tmp_path, design), design)


@needs("yosys")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["ulx3s-12f", "colorlight-i5", "orangecrab-25f", "arty-a7-35"])
def test_yosys_accepts_it_and_it_fits(name):
    taken = fit(design_for(TARGETS[name]))
    assert taken.ok, taken


@pytest.mark.parametrize("name", TARGETS)
def test_constraints_name_every_port_and_no_other(name):
    target = TARGETS[name]
    files = design_for(target).files()
    top = files[f"{TOP}.v"]
    head = top[top.index("module ") : top.index(");")]
    assert tuple(re.findall(r"(?:in|out)put wire (\w+)", head)) == PORTS
    assert max(map(len, top.splitlines())) <= 100
    if target.device.family == "ecp5":
        text = files["viform.lpf"]
        found = dict(re.findall(r'LOCATE COMP "(\w+)" SITE "(\w+)";', text))
        assert set(re.findall(r'IOBUF PORT "(\w+)" IO_TYPE=LVCMOS33', text)) == set(PORTS)
        assert f'FREQUENCY PORT "clk_in" {target.pin_hz / 1e6:g} MHZ;' in text
    else:
        text = files["viform.xdc"]
        found = {
            port: pin
            for pin, port in re.findall(
                r"\{ PACKAGE_PIN (\w+) IOSTANDARD LVCMOS33[^}]*\} \[get_ports (\w+)\]", text
            )
        }
        assert "create_clock -name clk_in -period 10.000 [get_ports clk_in]" in text
        assert "-divide_by 2 [get_pins half_reg/Q]" in text
        assert "reg half " in top
    assert found == pins(target)
