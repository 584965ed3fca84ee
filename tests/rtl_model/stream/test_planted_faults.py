"""Faults planted in a copy of the Verilog are caught, and so is the netlist that yosys makes."""

import shutil

import numpy as np
import pytest

from rtl_model.stream.lockstep import run
from rtl_model.stream.program import Case
from rtl_model.verilated import VERILOG
from rtl_model.verilated.build import missing
from tests.rtl_model.netlist import MODELS, netlist

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")

LINES = Case("lines", clocks=30_000)
EXTERNAL = Case("external", rows=4, pixels=8, depth=8)
MANY = Case("external", rows=1, columns=32, pixels=8, clocks=60_000)  # some thousand frames


class Bright(Case):
    """Light that saturates every charge, then darkness in which the rest fires."""

    @property
    def inputs(self):
        # Q = 255, one quantum is taken, 20 kHz, constant pattern of 255: 255 more in each tick.
        steady = [1, 1, 1, 0, 0, 1, 2, 0, 31 << 16, 20, 1, 255]
        inputs = np.tile(np.array(steady, np.uint64), (4000, 1))
        inputs[2000:, -1] = 0
        return inputs


BRIGHT = Bright("external", rows=1, columns=32, pixels=8)

FAULTS = {
    "data change while they wait": (
        LINES, "viform_fifo.v", "(!out_valid || out_ready)", "1'b1",
    ),
    "valid waits for ready": (
        LINES, "viform_fifo.v", "out_valid <= get || out_valid && !out_ready;",
        "out_valid <= get && out_ready || out_valid && !out_ready;",
    ),
    "the ring is a word too full": (
        LINES, "viform_stream.v", "FULLEST = DEPTH - TILES - 1", "FULLEST = DEPTH - TILES",
    ),
    "a cut plane goes on": (
        LINES, "viform_stream.v", "take = room && (opens || !cut)", "take = room",
    ),
    "a cut plane is not marked": (
        LINES, "viform_stream.v", "if (!opens && !cut) marked", "if (opens && !cut) marked",
    ),
    "the mark stays": (
        LINES, "viform_stream.v", "if (opens) marked <= 1'b0", "if (opens) marked <= marked",
    ),
    "every lost row is a lost plane": (
        LINES, "viform_stream.v", "if (opens || !cut) lost_planes", "lost_planes",
    ),
    "last a tile early": (
        Case("lines", columns=70), "viform_stream.v", "LAST_TILE = TILES - 1",
        "LAST_TILE = TILES - 2",
    ),
    "a plane's number lacks a bit": (
        LINES, "viform_stream.v", "{tile_frame[19:0]", "{tile_frame[18:0], 1'b0",
    ),
    "slips the wrong way": (LINES, "viform_lane.v", "slip + 3'd1", "slip - 3'd1"),
    "a slip is judged at once": (LINES, "viform_lane.v", "settles <= 1'b1", "settles <= 1'b0"),
    "three training words are enough": (
        LINES, "viform_lane.v", "else if (agreed == 2'd3)", "else if (agreed == 2'd2)",
    ),
    "wrong words add up": (
        LINES, "viform_lane.v", "agreed <= trains ? 2'd0", "agreed <= trains ? agreed",
    ),
    "a lane may be late by two clocks only": (
        LINES, "viform_lines.v", "marker || age != 3'd0 && age != 3'd4",
        "marker || age != 3'd0 && age < 3'd3",
    ),
    "another polynomial": (LINES, "viform_lines.v", "8'h07", "8'h31"),
    "heads of one row may differ": (LINES, "viform_lines.v", "if (in_head && |wrong)", "if (1'b0)"),
    "halves of the buffer are one": (LINES, "viform_lines.v", "half <= !half;", "half <= half;"),
    "a row beyond the last passes": (
        LINES, "viform_lines.v", "row >= ROWS[15:0]", "row > ROWS[15:0]",
    ),
    "threshold reached does not fire": (
        MANY, "viform_tick.v", "live && total >= q", "live && total > q",
    ),
    "hard reset keeps the rest": (
        EXTERNAL, "viform_tick.v", "rule == 2'd1 ? total", "1'b0 ? total",
    ),
    "charge wraps": (
        BRIGHT, "viform_tick.v",
        "left > 14'd4095 ? 12'hFFF : left[11:0]", "left[11:0]",
    ),
    "window ends a row late": (
        EXTERNAL, "viform_external.v", "row <= row_window[31:16]",
        "row <= row_window[31:16] + 16'd1",
    ),
    "ramp lacks the frame": (EXTERNAL, "viform_external.v", " + frame[7:0]", ""),
    "clear keeps the charge": (
        EXTERNAL, "viform_external.v", "fresh <= cleared;", "fresh <= 1'b0;",
    ),
    "a command changes while it waits": (
        EXTERNAL, "viform_external.v", "free = !mem_valid || mem_ready", "free = 1'b1",
    ),
    "one word more in flight": (
        EXTERNAL, "viform_external.v", "flight != IN_FLIGHT[FLIGHT_BITS:0]",
        "flight <= IN_FLIGHT[FLIGHT_BITS:0]",
    ),
    "a frame is never late": (EXTERNAL, "viform_external.v", "if (busy) overdue", "if (0) overdue"),
    "period a clock long": (
        EXTERNAL, "viform_external.v", "left <= period - 33'd1", "left <= period",
    ),
}  # fmt: skip


def planted(file, good, bad, folder):
    """A copy of the Verilog with the fault in it."""
    shutil.copytree(VERILOG, folder)
    path = folder / file
    text = path.read_text()
    assert text.count(good) == 1, "the Verilog has changed"
    path.write_text(text.replace(good, bad))
    return folder


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if place else [])
        for place, name in enumerate(FAULTS)
    ],
)
def test_a_planted_fault_is_caught(name, tmp_path):
    case, *fault = FAULTS[name]
    assert run(case).difference is None
    found = run(case, sources=planted(*fault, tmp_path / "verilog")).difference
    assert found is not None, "not caught"
    assert found[2] != found[3]


@pytest.mark.slow
@pytest.mark.skipif(MODELS is None, reason="needs yosys and its models of the ice40's cells")
@pytest.mark.parametrize(
    "case",
    [LINES, EXTERNAL, Case("external", rows=3, pixels=1, seed=2)],
    ids=["lines", "external", "external-1"],
)
def test_the_netlist_is_the_model(case, tmp_path):
    settings = case.geometry.verilog | case.settings
    top = f"viform_stream_{case.source}"
    sources = netlist(VERILOG, tmp_path / "gates", top, settings)
    assert "SB_LUT4" in (sources / f"{top}.v").read_text()
    outcome = run(case, sources=sources)
    assert outcome.difference is None, outcome.difference


@pytest.mark.slow
@pytest.mark.skipif(MODELS is None, reason="needs yosys and its models of the ice40's cells")
@pytest.mark.parametrize("name", ["the ring is a word too full", "slips the wrong way"])
def test_a_fault_in_the_source_is_caught_in_the_netlist(name, tmp_path):
    case, *fault = FAULTS[name]
    copy = planted(*fault, tmp_path / "verilog")
    settings = case.geometry.verilog | case.settings
    sources = netlist(copy, tmp_path / "gates", "viform_stream_lines", settings)
    assert run(case, sources=sources).difference is not None
