"""A fault of one bit in a copy of the Verilog is detected and located."""

import itertools
import re
import shlex
import shutil
from typing import NamedTuple

import pytest

from rtl_model import lockstep
from rtl_model.verilated import VERILOG
from rtl_model.verilated.build import missing
from tests.rtl_model.lockstep.bright import BRIGHT, FRAMES

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")

PROGRAM = lockstep.Program(rows=4, columns=40, lanes=32, seed=1)


class Fault(NamedTuple):
    """A replacement in a file, and the value in which the first difference must appear."""

    file: str
    good: str
    bad: str
    seen: str


FAULTS = {
    "threshold reached fires no more, only exceeded": Fault(
        "viform_pixels.v",
        "fired = is_live && !once[13];\n            keep = is_live && once[13];",
        "fired = is_live && !once[13] && once != 14'd0;\n            keep = is_live && !fired;",
        "spike",
    ),
    "threshold constant 254": Fault(
        "viform_pixels.v", "held[7:0]} - ~more", "held[7:0]} + more + 14'd2", "spike"
    ),
    "two quanta of another level": Fault(
        "viform_pixels.v", "{1'b0, k, 8'hFF}", "{1'b0, k ^ 4'd8, 8'hFF}", "spike"
    ),
    "20 kHz collects once": Fault(
        "viform_pixels.v", "{5'd0, collected, 1'b0}", "{6'd0, collected}", "spike"
    ),
    "hard reset keeps one electron": Fault(
        "viform_pixels.v",
        "| {12{full}}\n",
        "| {12{full}} | {11'd0, fired && reset_rule == 2'd1}\n",
        "spike",
    ),
    "window ends a column early": Fault(
        "viform_scan.v",
        "to = column_last - first;",
        "to = column_last - first - 16'd1;",
        "spike",
    ),
    "window begins a row late": Fault(
        "viform_scan.v", "read_row >= rows_now", "read_row > rows_now", "tile"
    ),
    "pads fire": Fault(
        "viform_scan.v",
        "{LANES{1'b1}} >> PADS : {LANES{1'b1}}",
        "{LANES{1'b1}} : {LANES{1'b1}}",
        "spike",
    ),
    "checker is offset": Fault(
        "viform_scan.v", "read_row[0] ^ frame_now[0]", "read_row[0] ^ frame_now[1]", "spike"
    ),
    "ramp lacks the tile": Fault(
        "viform_scan.v", "read_row[7:0] + base[7:0]", "read_row[7:0] + base[8:1]", "spike"
    ),
    "pattern seen a clock early": Fault(
        "viform_ram.v",
        "COLLIDES == 0 && write && write_address == read_address\n            ? {WIDTH{1'bx}}",
        "write && write_address == read_address\n            ? write_data",
        "spike",
    ),
    "clear keeps the first tile's charge": Fault(
        "viform_scan.v", "fresh = start ? clear : cleared;", "fresh = cleared;", "spike"
    ),
    "the first tile has the frame's number before": Fault(
        "viform_scan.v", "+ frame_now[7:0];", "+ frame[7:0];", "spike"
    ),
    "the first tile has the window before": Fault(
        "viform_scan.v", "start ? columns : column_window", "column_window", "spike"
    ),
    "frame counter starts at one": Fault(
        "viform_scan.v",
        "start ? clear ? 32'd0 : frames",
        "start ? clear ? 32'd1 : frames",
        "frame of the tile",
    ),
    "period a clock long": Fault(
        "viform_scan.v", "left <= period - 33'd1;", "left <= period;", "tile"
    ),
    "clear keeps the charge": Fault(
        "viform_scan.v", "cleared <= clear;", "cleared <= 1'b0;", "spike"
    ),
    "a reading collects electrons": Fault(
        "viform_pixels.v", "if (store)\n", "if (compute)\n", "spike"
    ),
    "a reading lends an electron more": Fault(
        "viform_reading.v", "= ramp[18:7];", "= ramp[18:7] + 12'd1;", "spike"
    ),
    "a reading compares with the threshold of now": Fault(
        "viform_sensor.v", "reading ? read_level : threshold", "threshold", "spike"
    ),
    "a reading lends twice at 20 kHz": Fault(
        "viform_sensor.v", "double && !reading", "double", "spike"
    ),
    "the threshold moves a reading under way": Fault(
        "viform_reading.v", "ramp - step;", "ramp - first;", "spike"
    ),
    "a reading lacks its last pass": Fault(
        "viform_reading.v",
        "(7'd1 << request) - 7'd2 :",
        "(7'd1 << request) - (request == 3'd1 ? 7'd2 : 7'd3) :",
        "tile|frame of the tile",
    ),
    "a reading is not cancelled by a reset": Fault(
        "viform_reading.v",
        "left <= 7'd0;\n            reading <= 1'b0;",
        "reading <= 1'b0;",
        "tile|frame of the tile|sensor_.*",
    ),
    "a reading counts as spikes": Fault(
        "viform_sensor.v", "tile_valid && !reading", "tile_valid", "sensor_.*"
    ),
    "a reading clears": Fault(
        "viform_sensor.v",
        "            if (!pass) begin",
        "            begin",
        "tile|frame of the tile|sensor_.*",
    ),
    "a reading waits for a run": Fault(
        "viform_scan.v", "(run || pass) && due", "run && due", "tile|sensor_.*"
    ),
    "CRC's polynomial": Fault(
        "viform_crc32.vh", "32'hEDB88320", "32'hEDB88321", "sink_crc|capture_data"
    ),
    "record's number": Fault(
        "viform_capture.v",
        "number <= number + 32'd1;",
        "number <= number;",
        "capture_data",
    ),
    "PRBS tap": Fault("viform_prbs.v", "bits[i+18]", "bits[i+17]", "prbs_(source|errors)"),
    "missing words are not dark": Fault(
        "viform_sink.v",
        "have != 2'd0 ? words[31:0] : 32'd0",
        "words[31:0]",
        "the sink's spike|sink_crc",
    ),
}


def planted(fault, folder):
    """A copy of the Verilog with the fault in it."""
    shutil.copytree(VERILOG, folder)
    path = folder / fault.file
    text = path.read_text()
    assert text.count(fault.good) >= 1, "the Verilog has changed"
    path.write_text(text.replace(fault.good, fault.bad, 1))
    return folder


def again(reproducer, sources):
    """Runs the command of a reproducer on the Verilog that it names."""
    words = shlex.split(reproducer)
    assert words[:4] == ["viform", "board", "compare", "--lockstep"]
    given = {name[2:]: value for name, value in zip(words[4::2], words[5::2], strict=True)}
    assert given.pop("sources") == str(sources)
    given = {name: int(value) for name, value in given.items()}
    until = given.pop("until")
    return lockstep.Program(**given), until


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if place else [])
        for place, name in enumerate(FAULTS)
    ],
)
def test_a_planted_fault_is_caught_and_located(name, tmp_path):
    fault = FAULTS[name]
    sources = planted(fault, tmp_path / "verilog")
    outcome = lockstep.run(PROGRAM, pixels=5e6, sources=sources)
    found = outcome.difference
    assert found is not None, "not caught"
    assert re.fullmatch(fault.seen, found.what), str(found)
    assert found.verilog != found.model
    assert found.what != "spike" or {found.verilog, found.model} == {0, 1}
    assert (found.row is None) == (found.column is None) == (found.frame is None)
    program, until = again(found.reproducer, sources)
    assert until == found.until > found.clock
    once_more = lockstep.run(program, until=until, sources=sources).difference
    assert once_more == found
    assert lockstep.run(program, until=found.clock, sources=sources).difference is None


@pytest.mark.slow
def test_a_charge_that_wraps_is_caught(tmp_path):
    good, full = "| {12{second}} & twice", "\n                    | {12{full}}"
    wraps = Fault("viform_pixels.v", good + full, good, "spike")
    sources = planted(wraps, tmp_path / "verilog")
    found = lockstep.run(BRIGHT, pixels=BRIGHT.pixels, sources=sources).difference
    assert found is not None, "not caught"
    assert (found.what, found.verilog, found.model) == (wraps.seen, 0, 1)
    assert found.frame is not None and found.frame > FRAMES  # held too little, seen in darkness


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".fst", ".vcd"])
def test_waveforms_stand_about_the_difference(ending, tmp_path):
    sources = planted(FAULTS["threshold constant 254"], tmp_path / "verilog")
    path = tmp_path / f"window{ending}"
    found = lockstep.run(PROGRAM, sources=sources, waves=path).difference
    assert found is not None
    assert found.waves == path
    view = path.with_suffix(".gtkw")
    shown = f"waveforms: {path}, displayed by `gtkwave {view}`"
    assert str(found).splitlines()[-1] == shown
    step = 10**12 / PROGRAM.geometry.clock_hz
    assert view.read_text().splitlines()[3].split()[1] == str(int(found.clock * step))
    assert 1000 < path.stat().st_size < 5_000_000
    if ending == ".vcd":
        text = path.read_text()
        times = [int(line[1:]) for line in text.splitlines() if re.fullmatch(r"#\d+", line)]
        assert times[0] == int((found.clock - 256) * step)
        assert times[-1] == int((found.until + 64 - 0.5) * step)
        assert all(a < b for a, b in itertools.pairwise(times))
        for name in ("tile_bits", "bus_we", "threshold"):
            assert re.search(rf"\b{name}\b", text)
