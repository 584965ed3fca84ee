"""Tops with LiteEth's core: pins, addresses, and three tools without a remark."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from cosim import InputError
from rtl_model.gateware import ETHERNET, TARGETS, design_for, ethernet_named, network, write_folder
from rtl_model.gateware.top import TOP, ethernet_pins
from tests.rtl_model.netlist import lint

HERE = Path(__file__).parent
EVERY = [(name, phy) for name, phys in ETHERNET.items() for phy in phys]
NET = network("192.168.1.50", "10:e2:d5:00:00:01")


def design(name, phy):
    return design_for(TARGETS[name], ethernet=phy, network=NET)


@pytest.mark.parametrize(("name", "phy"), EVERY, ids=lambda one: getattr(one, "name", one))
def test_the_core_alone_uses_the_pins_of_the_phy(name, phy):
    """nextpnr refuses LiteEth's input flip-flop in a pad whose signal has another load."""
    top = design(name, phy).files()[f"{TOP}.v"]
    body = top[top.index(");") :]
    for port in phy.pins:
        assert len(re.findall(rf"\({phy.kind}_{port}\)", body)) == 1
        assert len(re.findall(rf"\b{phy.kind}_{port}\b", body)) == 2  # the core's port, and this


@pytest.mark.parametrize(("name", "phy"), EVERY, ids=lambda one: getattr(one, "name", one))
def test_constraints_name_every_port_once(name, phy):
    target = TARGETS[name]
    files = design(name, phy).files()
    top = files[f"{TOP}.v"]
    head = top[top.index("module ") : top.index(");")]
    ports = set()
    for span, port in re.findall(r"(?:put|inout) wire (?:\[(\d+):0\] )?(\w+)", head):
        ports |= {f"{port}[{n}]" for n in range(int(span) + 1)} if span else {port}
    pins = ethernet_pins(target, phy)
    assert ports == set(pins)
    assert len(set(pins.values())) == len(pins)
    constraints = files.get("viform.lpf") or files["viform.xdc"]
    for port, pin in pins.items():
        site = re.escape(port)
        assert re.search(rf'"{site}" SITE "{pin}"|PACKAGE_PIN {pin} .*{site}', constraints)
    assert max(map(len, top.splitlines())) <= 100
    clock = 1e9 / phy.clock_hz
    assert clock <= 32 or phy.kind != "rgmii"  # LiteEth's 32 bits a clock against 8 bits at 125 MHz
    assert f"clk_freq: {phy.clock_hz}" in files["liteeth.yml"]
    assert f".CLOCK_HZ({phy.clock_hz})" in top
    assert "liteeth_core.v: liteeth.yml" in files["Makefile"]
    assert "udp:192.168.1.50" in files["README.md"]


@pytest.mark.skipif(shutil.which("verilator") is None, reason="needs Verilator")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "phy"),
    [(name, ETHERNET[name][0]) for name in ("ulx3s-25f", "colorlight-i5", "arty-a7-35")],
    ids=lambda one: getattr(one, "name", one),
)
def test_verilator_has_nothing_to_remark(name, phy, tmp_path):
    write_folder(design(name, phy), tmp_path / "made")
    shutil.copy(HERE / "liteeth" / f"{phy.kind}.v", tmp_path / "made/liteeth_core.v")
    (tmp_path / "made/vendor").symlink_to(HERE)
    done = lint(TOP, folder=tmp_path / "made", options=["-Ivendor"])
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_names_and_addresses_that_cannot_be_are_one_line():
    for act, says in (
        (lambda: ethernet_named("ulx3s-25f", "phy9"), "must be one of rmii, not 'phy9'"),
        (lambda: ethernet_named("orangecrab-25f", "rmii"), "must be left out"),
        (lambda: network("192.168.1", "10:e2:d5:00:00:01"), "an IPv4 address of a host"),
        (lambda: network("224.0.0.1", "10:e2:d5:00:00:01"), "an IPv4 address of a host"),
        (lambda: network("10.0.0.2", "11:e2:d5:00:00:01"), "six bytes of a single host"),
        (lambda: network("10.0.0.2", "10:e2:d5"), "six bytes of a single host"),
    ):
        with pytest.raises(InputError) as refused:
            act()
        assert says in str(refused.value) and "\n" not in str(refused.value)
    assert network("10.0.0.2", "10-e2-d5-00-00-01").mac == 0x10E2D5000001


@pytest.mark.slow
@pytest.mark.parametrize(("name", "phy"), EVERY, ids=lambda one: getattr(one, "name", one))
def test_liteeth_writes_a_core_with_the_ports_of_the_stand_in(name, phy, tmp_path):
    """Runs `make liteeth_core.v` with the liteeth_gen beside VIFORM_LITEX_PYTHON."""
    python = os.environ.get("VIFORM_LITEX_PYTHON")
    if not python:
        pytest.skip("VIFORM_LITEX_PYTHON names no Python with LiteX and LiteEth (2024.12)")
    write_folder(design(name, phy), tmp_path / "made")
    tool = Path(python).parent / "liteeth_gen"
    make = ["make", "-C", tmp_path / "made", f"LITEETH_GEN={tool}", "liteeth_core.v"]
    subprocess.run(make, check=True, timeout=300, stdout=subprocess.DEVNULL)

    def ports(text):
        head = text[text.index("module liteeth_core (") :]
        port = r"(input|output|inout)\s+(?:wire|reg)\s*(\[\d+:0\])?\s+(\w+)"
        return set(re.findall(port, head[: head.index(");")]))

    made = (tmp_path / "made/liteeth_core.v").read_text()
    assert ports(made) == ports((HERE / "liteeth" / f"{phy.kind}.v").read_text())
