"""The Verilog of the event path in lockstep with its cycle models, and planted faults."""

import shutil
from typing import NamedTuple

import pytest

from rtl_model.events.encoder import EventSize
from rtl_model.verilated import VERILOG
from rtl_model.verilated.build import missing
from tests.rtl_model.events.path import Light, run
from tests.rtl_model.netlist import lint

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")

SIZE = EventSize(16, 40, 32, 64, 32, tile=70_000)
"""Its second tile is partly filled, and its queue is soon full."""
DIM, BUSY = Light(0.02), Light(0.1)


@pytest.mark.parametrize(("light", "slack"), [(DIM, 50), (BUSY, 0)])
def test_the_verilog_is_the_model(light, slack):
    result = run(SIZE, light, 8e6, slack=slack, verilog=True)
    assert result.failure == ""
    assert result.packets > 40
    assert result.gaps > 40 and result.lost_spikes > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "size",
    [
        EventSize(), EventSize(128, 128, 64, depth=1024), EventSize(1, 1, 32, 128, 16),
        EventSize(7, 33, 64, 32, 16), EventSize(3, 128, 32, 64, 16),
    ],
)  # fmt: skip
@pytest.mark.parametrize("light", [DIM, BUSY, Light(0.3), Light(1.0, ready=1)])
def test_the_verilog_is_the_model_in_every_size(size, light):
    pixels = min(2e7, 400 * size.pixels * size.cycles)
    result = run(size, light, pixels, slack=40, verilog=True, seed=3)
    assert result.failure == ""
    assert result.packets > 0


@pytest.mark.skipif(shutil.which("verilator") is None, reason="needs the system package verilator")
@pytest.mark.parametrize("size", [EventSize(), EventSize(1, 1, 32, 32, 16), EventSize(7, 100, 64)])
@pytest.mark.parametrize("name", ["encoder", "decoder"])
def test_verilator_has_nothing_to_remark(name, size):
    top = VERILOG / f"viform_event_{name}.v"
    known = {name: n for name, n in size.verilog.items() if f"] {name} =" in top.read_text()}
    done = lint(top.stem, known)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


class Fault(NamedTuple):
    """A replacement in a file, and how the first difference begins."""

    file: str
    good: str
    bad: str
    seen: str


ENCODER, DECODER, QUEUE = (f"viform_event_{name}.v" for name in ("encoder", "decoder", "queue"))
WORD, CODED, COUNTS = "word ", "words of the decoder", "counts of what was lost"
FAULTS = {
    "a width that repeats is sent": Fault(
        ENCODER, "!held[14] || held[6:0] != width", "1'b1", WORD
    ),
    "a width a cycle long": Fault(ENCODER, "since - 7'd1;", "since;", WORD),
    "the first width counts from cycle 0": Fault(
        ENCODER, "!held[14] ? due_cycle :", "!held[14] ? due_cycle - 7'd1 :", WORD
    ),
    "no closing spikes": Fault(
        ENCODER, "due_sweep ? held[14] && held[6:0] < width", "due_sweep ? 1'b0", WORD
    ),
    "closing spikes where the next one falls on the end": Fault(
        ENCODER, "held[6:0] < width", "held[6:0] <= width", WORD
    ),
    "a pixel remembers the packet before": Fault(
        ENCODER, "due_sweep ? 15'd0 :", "due_sweep ? held :", WORD
    ),
    "the highest column is served first of two": Fault(
        ENCODER, "left & (~left + {{LANES - 1{1'b0}}, 1'b1})",
        "left & (left - {{LANES - 1{1'b0}}, 1'b1}) ? left & (left - {{LANES - 1{1'b0}}, 1'b1})"
        " & (~(left & (left - {{LANES - 1{1'b0}}, 1'b1})) + {{LANES - 1{1'b0}}, 1'b1}) : left",
        WORD,
    ),
    "a word changes while it waits": Fault(
        ENCODER, "if (m_free) begin\n            m_tvalid", "begin\n            m_tvalid", WORD
    ),
    "the checksum lacks the head": Fault(
        ENCODER, "if (put && body) crc", "if (put && body && state != HEAD) crc", WORD
    ),
    "the head's cycle is twice what it is": Fault(
        ENCODER, "<< (GROUP - 5)", "<< (GROUP - 4)", WORD
    ),
    "a row word for each event": Fault(
        ENCODER, "&& said_row == due_row", "&& said_row == due_row && !m_tdata[15]", WORD
    ),
    "the gap's end is not said": Fault(
        ENCODER, "&& !(start && !gap_said);", "&& !gap_said && !start;", WORD
    ),
    "a pixel of the second tile is that of the first": Fault(
        ENCODER, "{read_row[ROW_BITS-1:0], read_column[COLUMN_BITS-1:0]}",
        "{read_row[ROW_BITS-1:0], 1'b0, read_column[COLUMN_BITS-2:0]}", WORD
    ),
    "a queue that takes a row without room": Fault(
        QUEUE, "DEPTH - TILES - 2;", "DEPTH - TILES + 1;", WORD
    ),
    "reading goes on too soon": Fault(QUEUE, "HALF = DEPTH / 2;", "HALF = DEPTH / 2 + 4;", WORD),
    "lost spikes of the first tile alone": Fault(
        QUEUE, "if (tile_valid && !taken) lost_spikes", "if (first && !taken) lost_spikes", COUNTS
    ),
    "a loss is not said": Fault(QUEUE, "wire loss = first && !room && !lost;",
                                "wire loss = first && !room && !lost && jump;", WORD),
    "a repetition too few": Fault(
        DECODER, "again <= next_cursor <= stop;", "again <= next_cursor < stop;", CODED
    ),
    "repetitions go on after a closing spike": Fault(
        DECODER, "last[15] && !last[14] &&", "last[15] &&", CODED
    ),
    "spikes of the packet before remain": Fault(
        DECODER, "sent ? 32'd0 : bits", "sent ? stored : bits", CODED
    ),
    "a damaged packet passes": Fault(
        DECODER, "head != 3'd6 || ~crc != sum", "head != 3'd6 || ~crc == sum", CODED
    ),
    "the last pixel is not written back": Fault(
        DECODER, "state == FLUSH && bits_valid;", "1'b0;", CODED
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if place else [])
        for place, name in enumerate(FAULTS)
    ],
)
def test_a_planted_fault_is_caught(name, tmp_path):
    fault = FAULTS[name]
    sources = tmp_path / "verilog"
    shutil.copytree(VERILOG, sources)
    path = sources / fault.file
    text = path.read_text()
    assert text.count(fault.good) == 1, "the Verilog has changed"
    path.write_text(text.replace(fault.good, fault.bad))
    result = run(SIZE, BUSY, 3e6, verilog=True, sources=sources)
    assert result.failure.startswith(fault.seen), result.failure or "not caught"
