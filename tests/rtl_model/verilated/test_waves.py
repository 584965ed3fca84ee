"""Waveforms of the board: in real time, with its line and its bus, and a view of them."""

from __future__ import annotations

import itertools
import re

from rtl_model.bringup.machine.waves import Trace, write_waves
from rtl_model.cycle import System
from rtl_model.geometry import Geometry
from rtl_model.host.uartbone import read_request, write_request
from rtl_model.registers import REGISTERS
from rtl_model.verilated import VerilatedSystem, Waves
from tests.rtl_model.virtual.hosts import needs_verilator

pytestmark = needs_verilator
SIZE = Geometry(rows=4, columns=40, clock_hz=3_000_000, baud=750_000)
ADDRESS = {register.name: register.address for register in REGISTERS}


def waveforms(path):
    """{name: [(ps, value), ...]} of a VCD of Verilator, and the word after `$timescale`."""
    head, _, body = path.read_text().partition("$enddefinitions $end")
    scopes, keys, changes = [], {}, {}
    for line in head.splitlines():
        words = line.split() or [""]
        if words[0] == "$scope":
            scopes.append(words[2])
        elif words[0] == "$upscope":
            scopes.pop()
        elif words[0] == "$var":
            name = ".".join([*scopes, words[4] + ("" if words[5] == "$end" else words[5])])
            keys.setdefault(words[3], []).append(name)
    now = 0
    for line in body.splitlines():
        change = re.fullmatch(r"b([01]+) (\S+)|([01])(\S+)", line)
        if line.startswith("#"):
            now = int(line[1:])
        elif change:
            value, key = (change[1], change[2]) if change[1] else (change[3], change[4])
            for name in keys[key]:
                changes.setdefault(name, []).append((now, int(value, 2)))
    return changes, re.search(r"\$timescale\s+(\S+)", head)[1]


def decoded(changes, begin, bit):
    """Bytes of a line, 8N1."""

    def level(at):
        return [value for time, value in changes if time <= at][-1]

    data, at, last = b"", begin, changes[-1][0]
    while at <= last:
        if level(at):
            at += bit // 8
            continue
        edge = max(time for time, value in changes if time <= at and not value)
        bits = [level(edge + int((n + 0.5) * bit)) for n in range(1, 10)]
        assert bits[8] == 1
        data += bytes([sum(value << n for n, value in enumerate(bits[:8]))])
        at = edge + int(9.5 * bit)
    return data


def test_a_trace_holds_the_line_and_the_bus_in_picoseconds(tmp_path):
    path = tmp_path / "first.vcd"
    write_waves(Trace(path, SIZE), seed=2)
    signals, timescale = waveforms(path)
    assert timescale == "1ps"
    rises = [time for time, value in signals["TOP.viform_board.clk"] if value]
    assert {b - a for a, b in itertools.pairwise(rises)} == {333_333, 333_334}

    bit = SIZE.bit_clocks * 10**12 // SIZE.clock_hz
    sent = decoded(signals["TOP.viform_board.serial_rx"], rises[0], bit)
    assert sent == write_request(ADDRESS["sensor_threshold"], [0]) + write_request(
        ADDRESS["sensor_run"], [1]
    ) + read_request(ADDRESS["sensor_spikes"], 1)
    answer = decoded(signals["TOP.viform_board.serial_tx"], rises[0], bit)
    read = [value for _, value in signals["TOP.viform_board.core.bus_rdata[31:0]"]]
    assert len(answer) == 4 and int.from_bytes(answer, "big") in read

    view = path.with_suffix(".gtkw").read_text().splitlines()
    names = [line for line in view if line.startswith("TOP.")]
    assert len(names) > 10 and set(names) <= set(signals)
    cursor, *marks = (int(word) for word in view[3].split()[1:] if word != "-1")
    assert cursor == rises[0]
    first_rows = signals["TOP.viform_board.tile_frame[31:0]"]
    assert marks[1] in [time for time, _ in first_rows]  # the second frame begins there


def test_a_trace_of_the_system_begins_at_its_clock(tmp_path):
    path = tmp_path / "system.vcd"
    with VerilatedSystem(SIZE, waves=Waves(path, 50, 90)) as verilog:
        tiles = verilog.run(200, [(60, ADDRESS["sensor_run"], 1)])
    assert len(tiles) == len(System(SIZE).run(200, [(60, ADDRESS["sensor_run"], 1)])) > 0
    signals, timescale = waveforms(path)
    assert timescale == "1ps"
    rises = [time for time, value in signals["TOP.viform_system.clk"] if value]
    assert rises[0] == 50 * 10**12 // SIZE.clock_hz and len(rises) == 40
    assert [t for t, v in signals["TOP.viform_system.bus_we"] if v] == [rises[10]]
