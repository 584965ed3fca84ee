"""All imagers behind their line: sound tables, documents that are the tables, the host's view, a
virtual one behind a pty."""

import json
import random
import re
import signal
import sys
from pathlib import Path

import pytest

from cosim import InputError
from imagers.catalogue import IMAGERS, kind_of
from imagers.common.registers import ImagerBus, line_of
from imagers.document import document
from imagers.emccd.device.timing import window_table
from rtl_model.host import Board, Cause, LineFault, Uartbone, read_csr, recognised
from rtl_model.host.csr import device_map
from rtl_model.virtual import VirtualBoard
from tests.rtl_model.host.conftest import ModelPort
from tests.rtl_model.registers.checks import faults

ROOT = Path(__file__).resolve().parents[2]

WITH_REGISTERS = [name for name, kind in IMAGERS.items() if kind.number is not None]


def test_the_documents_are_made_of_the_tables():
    assert (ROOT / "docs" / "imager-registers.md").read_text(encoding="utf-8") == document()
    text = (ROOT / "docs" / "emccd.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| ([\d.]+) \|$", text, re.MULTILINE)
    assert [(int(size), rate) for size, rate in rows] == [
        (size, f"{rate:.2f}") for size, rate in window_table()
    ]


@pytest.mark.parametrize("name", IMAGERS)
def test_the_page_of_the_imagers_names_every_kind_and_its_keys(name):
    text = (ROOT / "docs" / "imagers.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if re.match(rf"\| `.*`{name}`|\| `{name}`", line))
    said = set(re.findall(r"`\[?(?:imager\.)?(\w+)\]?`", text))
    assert set(IMAGERS[name].section.model_fields) - said - {"kind"} == set(), row


@pytest.mark.parametrize("name", WITH_REGISTERS)
def test_every_table_is_sound(name):
    made = kind_of(name).design()
    assert (made.name, made.number) == (name, IMAGERS[name].number)
    assert [k for k, kind in IMAGERS.items() if kind.number == made.number] == [name]
    assert faults(made.registers, made.memories, made.values) == []
    assert {type(entry.reset) for entry in made.specific} == {int}


@pytest.mark.parametrize("name", WITH_REGISTERS)
def test_a_machine_advanced_in_pieces_is_the_one_advanced_at_once(name):
    """Every register that is only read, at random clocks; and again after a reset."""
    rng = random.Random(4)
    bus, whole = ImagerBus(kind_of(name).bus_target()), None
    registers = [
        entry
        for entry in kind_of(name).design().specific
        if entry.mode == "ro" and not entry.read_effect
    ]
    hz = kind_of(name).design().clock_hz
    clock, seen = 0, set()
    for part in range(24):
        clock += rng.choice((1, 2, 50, hz // 1000, hz // 50, hz // 10))
        bus.advance(clock)
        if part % 6 == 5:
            whole = ImagerBus(kind_of(name).bus_target())
            whole.advance(clock)
            values = [whole.target.registers.read(entry.name) for entry in registers]
            assert values == [bus.target.registers.read(entry.name) for entry in registers], clock
            seen.add(tuple(values))
    assert len(seen) > 1
    reset = next(
        entry.address for entry in kind_of(name).design().registers if entry.name == "ctrl_reset"
    )
    bus.write(reset, 1)
    fresh = ImagerBus(kind_of(name).bus_target())
    for step in (1, hz // 7, hz // 3):
        bus.advance(bus.clock + step)
        fresh.advance(fresh.clock + step)
        for entry in registers:
            if not entry.name.endswith("_clock"):  # an instant since power-on
                assert bus.target.registers.read(entry.name) == fresh.target.registers.read(
                    entry.name
                ), entry.name


@pytest.mark.parametrize("name", WITH_REGISTERS)
def test_the_host_knows_it_by_its_first_register(name, tmp_path):
    made = kind_of(name).design()
    port = ModelPort(made.geometry, bridge=line_of(kind_of(name).bus_target()))
    bone = Uartbone(port, baud=made.baud)
    known = recognised(bone, IMAGERS)
    assert known == device_map(kind_of(name).design())
    assert known.imager == name
    path = tmp_path / "csr.csv"
    path.write_text(made.csr_csv())
    assert read_csr(path, IMAGERS) == known
    board = Board(bone, known)
    info = board.imager_info()
    assert (info.imager, info.rows, info.columns, info.clock_hz) == (
        name, *made.shape, made.clock_hz,
    )  # fmt: skip
    assert info.baud == pytest.approx(made.baud, rel=0.51 / made.geometry.bit_clocks)
    assert board.identifier() == made.identifier
    for entry in made.registers:
        if entry.mode != "wo" and not entry.read_effect:
            assert board.read(entry.name) < 1 << entry.width
    board.write("ctrl_scratch", 0xA5A5A5A5)
    assert board.read("ctrl_scratch") == 0xA5A5A5A5
    assert board.read("ctrl_bus_errors") == 0
    with pytest.raises(LineFault) as caught:
        Board(bone).info()
    assert caught.value.cause is Cause.NOT_OURS
    other = next(each for each in WITH_REGISTERS if each != name)
    with pytest.raises(LineFault, match=name):
        Board(bone, device_map(kind_of(other).design()), devices=IMAGERS).imager_info()


def test_the_spike_board_is_still_itself():
    port = ModelPort()
    known = recognised(Uartbone(port), IMAGERS)
    assert known.is_viform_board
    assert known.imager is None
    with pytest.raises(LineFault, match="not emccd"):
        Board(Uartbone(port), device_map(kind_of("emccd").design())).imager_info()


def test_no_such_imager_is_one_line():
    with pytest.raises(InputError, match="one of adaptive-exposure, ebaps, emccd"):
        kind_of("vidicon")


def run(monkeypatch, capsys, *options):
    """(exit code, standard output, standard error) of `viform board ...`."""
    from scenarios.cli.entry import main

    monkeypatch.setattr(sys, "argv", ["viform", "board", *options])
    monkeypatch.setattr("cosim.compute.stopping.end_on_signals", lambda: None)
    handler = signal.getsignal(signal.SIGTERM)
    code = 0
    try:
        main()
    except SystemExit as ended:
        code = ended.code
    finally:
        signal.signal(signal.SIGTERM, handler)
    said = capsys.readouterr()
    return code or 0, said.out, said.err


def test_identify_and_regs_work_on_a_virtual_one(monkeypatch, capsys):
    """Behind a pty, with nothing but its port given."""
    geometry = kind_of("emccd").design().geometry
    with VirtualBoard(geometry, level="model", device=kind_of("emccd")) as board:
        options = ["--port", board.port, "--time-scale", str(board.time_scale), "--json"]
        code, out, err = run(monkeypatch, capsys, "identify", *options)
        assert (code, err) == (0, "")
        told = json.loads(out)
        assert told["identifier"] == "Viform emccd 528x536"
        assert told["board"]["imager"] == "emccd"
        code, out, err = run(
            monkeypatch, capsys, "regs", "--set", "emccd_rows=16", "emccd_rows", "emccd_cycles",
            "emccd_state", *options,
        )  # fmt: skip
        assert (code, err) == (0, "")
        rows = {row["name"]: row for row in json.loads(out)["registers"]}
        assert rows["emccd_rows"]["value"] == 16
        assert rows["emccd_cycles"]["value"] > 0
        assert rows["emccd_state"]["fields"]["phase"] in range(1, 8)
        code, out, err = run(monkeypatch, capsys, "regs", "sensor_rows", *options)
        assert code == 2
        assert "one of this design" in err
        assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--imager", "vidicon"), "adaptive-exposure, ebaps, emccd"),
        (("--imager", "emccd", "--level", "pins"), "level model"),
        (("--imager", "emccd", "--fault", "foreign"), "faults of its line"),
        (("--imager", "emccd", "--rows", "4"), "an imager has its own"),
    ],
)
def test_bad_input_is_one_line(options, says, monkeypatch, capsys):
    code, out, err = run(monkeypatch, capsys, "virtual", *options)
    assert (code, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1
