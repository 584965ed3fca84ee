"""Numbered writes and the capture memory by address, in the cycle model and in the Verilog."""

import shutil

import pytest

from rtl_model.cycle import System
from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS
from rtl_model.verilated import VerilatedSystem

ADDRESS = {entry.name: entry.address for entry in (*REGISTERS, *MEMORIES)}
PLACE = ADDRESS["write_mem"]
SIZE = Geometry(rows=3, columns=40, lanes=32, clock_hz=4_000_000, capture_words=64, sink_words=16)


def verilog():
    if shutil.which("verilator") is None:
        pytest.skip("needs Verilator (packages: verilator g++ make)")
    return VerilatedSystem(SIZE)


@pytest.fixture(
    params=[lambda: System(SIZE), pytest.param(verilog, marks=pytest.mark.slow)],
    ids=["model", "verilog"],
)
def board(request):
    return request.param()


def numbered(board, number, address, *words, count=None):
    for index, value in enumerate((number, address, count or len(words), *words)):
        board.write(PLACE + 4 * index, value)


def test_a_numbered_write_is_done_once_and_in_order(board):
    pattern = ADDRESS["pattern_mem"]
    numbered(board, 0, pattern, 11, 12)
    assert [board.read(pattern + 4 * n) for n in range(3)] == [11, 12, 0]
    assert board.read(PLACE) == 1
    numbered(board, 0, pattern, 21, 22)  # a repetition
    numbered(board, 2, pattern, 31, 32)  # one that came too early
    numbered(board, 0xFFFFFFFF, pattern, 41)
    assert [board.read(pattern + 4 * n) for n in range(2)] == [11, 12]
    numbered(board, 1, pattern + 4, 51)
    assert [board.read(pattern + 4 * n) for n in range(2)] == [11, 51]
    assert [board.read(PLACE), board.read(PLACE + 4), board.read(PLACE + 8)] == [2, 5, 0]
    assert board.read(ADDRESS["ctrl_bus_errors"]) == 0


def test_words_for_a_queue_go_to_one_address_and_not_beyond_the_count(board):
    numbered(board, 0, ADDRESS["sink_data"] | 1, *range(5), count=3)
    assert board.read(ADDRESS["sink_level"]) == 3
    numbered(board, 0, ADDRESS["sink_data"] | 1, *range(5))
    assert board.read(ADDRESS["sink_level"]) == 3
    assert board.read(ADDRESS["ctrl_bus_errors"]) == 0


def test_an_unfinished_one_may_be_repeated(board):
    numbered(board, 0, ADDRESS["pattern_mem"], 1, 2, count=3)
    assert board.read(PLACE) == 0
    numbered(board, 0, ADDRESS["pattern_mem"], 1, 2, 3)
    assert board.read(PLACE) == 1
    assert [board.read(ADDRESS["pattern_mem"] + 4 * n) for n in range(3)] == [1, 2, 3]


def test_a_reset_keeps_the_number(board):
    numbered(board, 0, ADDRESS["ctrl_scratch"], 5)
    numbered(board, 1, ADDRESS["ctrl_reset"], 1)
    assert board.read(ADDRESS["ctrl_scratch"]) == 0x12345678
    assert board.read(PLACE) == 2


def test_no_numbered_write_goes_into_its_own_memory(board):
    numbered(board, 0, PLACE, 7, 7)
    assert [board.read(PLACE), board.read(PLACE + 4)] == [1, 1]
    assert board.read(ADDRESS["ctrl_bus_errors"]) == 2


def test_the_capture_memory_by_address_is_what_the_queue_gives(board):
    for name, value in (("sensor_pattern", 2), ("sensor_level", 90), ("sensor_threshold", 0)):
        board.write(ADDRESS[name], value)
    board.write(ADDRESS["capture_arm"], 2)
    board.write(ADDRESS["sensor_run"], 1)
    board.run(4 * SIZE.tick_clocks)
    base, level = ADDRESS["capture_mem"], board.read(ADDRESS["capture_level"])
    assert level == 2 * SIZE.rows * SIZE.record_words
    words = [board.read(base + 4 * n) for n in range(SIZE.capture_words)]
    assert [board.read(base + 4 * n) for n in (5, 3, 3)] == [words[5], words[3], words[3]]
    assert board.read(ADDRESS["capture_level"]) == level
    assert [board.read(ADDRESS["capture_data"]) for _ in range(level)] == words[:level]
    assert words[level:] == [0] * (SIZE.capture_words - level)
    board.write(base, 1)
    assert board.read(ADDRESS["ctrl_bus_errors"]) == 0
    assert board.read(base + 4 * SIZE.capture_words) == 0
    assert board.read(ADDRESS["ctrl_bus_errors"]) == 1
