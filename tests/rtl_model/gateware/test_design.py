"""Targets, bauds, memories, and the atomic writing of the folder."""

import shutil

import pytest

from cosim import InputError
from rtl_model.gateware import TARGETS, design_for, target_named, write_folder
from rtl_model.gateware import design as written
from rtl_model.gateware.targets import TOLERANCE, baud_error, block_rams, check_baud
from rtl_model.geometry import Geometry
from rtl_model.registers import csr_csv
from rtl_model.synthesis import synthesise
from rtl_model.verilated import VERILOG, build_crc

ULX3S = TARGETS["ulx3s-25f"]


def test_names_parts_and_pins_are_whole():
    for name, target in TARGETS.items():
        assert target.name == name
        four = {target.clock, target.tx, target.rx, target.led}
        assert len(four) == 4
        assert all(pin[0].isalpha() and pin[1:].isdigit() for pin in four)
        assert target.clock_hz * target.divide == target.pin_hz
        assert target.divide == 1 or target.device.family == "xc7"  # what the top can divide
        assert bool(target.loader) != bool(target.dfu)
        assert target.speed in target.part
    with pytest.raises(InputError, match=r"one of ulx3s-12f, ulx3s-25f, .* not 'ulx4s'"):
        target_named("ulx4s")


@pytest.mark.parametrize(
    ("clock", "baud", "error"),
    [
        (25_000_000, 115_200, 25e6 / 217 / 115_200 - 1),
        (25_000_000, 1_500_000, 25e6 / 17 / 1.5e6 - 1),  # -1.96 %, just good
        (50_000_000, 2_500_000, 0.0),
    ],
)
def test_a_baud_that_is_near_enough(clock, baud, error):
    assert baud_error(clock, baud) == pytest.approx(error, abs=1e-12)
    assert abs(error) <= TOLERANCE
    check_baud(clock, baud)


@pytest.mark.parametrize(
    ("clock", "baud", "says"),
    [
        (
            25_000_000,
            2_000_000,
            "for which 13 clocks a bit are off by -3.8 %; take 1500000 or 2500000",
        ),
        (25_000_000, 3_000_000, "for which 8 clocks a bit are off by +4.2 %; take 2500000"),
        (25_000_000, 12_000_000, "less than 4 clocks a bit; take 2500000"),
        (25_000_000, 300, "at least"),
    ],
)
def test_a_baud_that_is_not_is_one_line_with_the_nearest_good(clock, baud, says):
    with pytest.raises(InputError) as refused:
        check_baud(clock, baud)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("geometry", "blocks"),
    [
        # 18 kbit blocks that yosys 0.23 mapped, alike in ecp5 and in xc7 (where a RAMB36 is two).
        (Geometry(), 36),
        (Geometry(rows=64, columns=64, capture_words=2048, sink_words=512), 32),
        (Geometry(rows=7, columns=200, lanes=64, capture_words=64, sink_words=16), 54),
    ],
)
def test_block_rams_in_closed_form(geometry, blocks):
    assert block_rams(geometry) == blocks


@pytest.mark.skipif(shutil.which("yosys") is None, reason="needs the system package yosys")
@pytest.mark.slow
@pytest.mark.parametrize(("depth", "bits"), [(800, 10), (1500, 11), (3000, 12)])
def test_deep_memories_mix_shapes_as_yosys_does(depth, bits):
    """One more group of lanes adds pattern and charges of four pixels, and 32 bits of the copy that
    the bus reads."""
    cells = synthesise("ecp5", top="viform_pixels", settings={"DEPTH": depth, "ADDRESS_BITS": bits})
    tall = Geometry(rows=depth, columns=32)
    alone = block_rams(tall) - block_rams(Geometry(rows=1))
    copy = block_rams(Geometry(capture_words=8 * depth)) - block_rams(Geometry(capture_words=1))
    assert (alone - copy) / 8 + 3 == cells.block_rams


def test_memories_are_cut_only_where_they_do_not_fit():
    assert design_for(ULX3S).geometry == Geometry(clock_hz=25_000_000)
    small = design_for(TARGETS["ulx3s-12f"]).geometry
    assert small == Geometry(clock_hz=25_000_000, capture_words=2048)
    assert block_rams(small) == 32
    with pytest.raises(InputError, match=r"fits the 56 block RAMs .* not one that needs \d+ with"):
        design_for(ULX3S, rows=1000, columns=1000)


def test_the_folder_holds_all_that_builds_it(tmp_path):
    design = design_for(ULX3S, rows=8)
    files = write_folder(design, tmp_path / "made")
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == files
    for path in VERILOG.iterdir():
        assert (tmp_path / "made" / path.name).read_bytes() == path.read_bytes()
    assert (tmp_path / "made/csr.csv").read_text() == csr_csv(design.geometry)
    # What `viform board identify` reads back of it.
    assert design.build == build_crc(design.geometry)
    assert f"32'h{design.build:08X}" in (tmp_path / "made/viform_top.v").read_text()
    assert f"{design.build:08x}" in (tmp_path / "made/README.md").read_text()
    makefile = (tmp_path / "made/Makefile").read_text()
    assert "--25k --package CABGA381 --speed 6" in makefile
    assert "-b ulx3s viform.bit" in makefile


def test_each_target_has_its_way_to_be_loaded():
    makefiles = {name: design_for(target).files()["Makefile"] for name, target in TARGETS.items()}
    assert "--12k" in makefiles["ulx3s-12f"]
    assert "--idcode 0x21111043" in makefiles["ulx3s-12f"]
    assert "dfu-suffix\n" in makefiles["orangecrab-25f"]
    assert "-v 1209 -p 5af0" in makefiles["orangecrab-25f"]
    assert "-b arty_a7_100t -f viform.bit" in makefiles["arty-a7-100"]
    assert "-part xc7a100tcsg324-1 " in design_for(TARGETS["arty-a7-100"]).files()["build.tcl"]


def test_an_empty_folder_is_filled_and_any_other_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    write_folder(design_for(ULX3S), tmp_path / "empty")
    with pytest.raises(InputError, match="a new or an empty folder"):
        write_folder(design_for(ULX3S), tmp_path / "empty")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="must be a folder, not a file"):
        write_folder(design_for(ULX3S), tmp_path / "file")
    with pytest.raises(InputError, match="in a folder that exists"):
        write_folder(design_for(ULX3S), tmp_path / "a/b")


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("name", ["viform_sink.v", "Makefile"])
def test_what_fails_midway_leaves_nothing(tmp_path, monkeypatch, there, name):
    """The disk becomes full while files are moved."""

    real = written.os.replace

    def full(source, place):
        if place.name == name:
            raise OSError(28, "No space left on device")
        real(source, place)

    place = tmp_path / "made"
    if there:
        place.mkdir()
    monkeypatch.setattr(written.os, "replace", full)
    with pytest.raises(OSError, match="No space left on device"):
        write_folder(design_for(ULX3S), place)
    assert place.exists() is there
    assert not there or not list(place.iterdir())
