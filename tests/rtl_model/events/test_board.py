"""The event path behind the board's array, whose registers are written in mid-run."""

import itertools

import numpy as np
import pytest

from rtl_model import lockstep
from rtl_model.cycle import System
from rtl_model.events.encoder import EventEncoder, EventSize
from rtl_model.lockstep.program import ADDRESS
from rtl_model.verilated.build import missing
from sensor.codec.packets.event import encode_events
from tests.rtl_model.events.path import packets_in, random_ready, unequal
from tests.rtl_model.events.verilated import VerilatedEncoder
from tests.sensor.codec.packets.told import gaps_of

SIZE = EventSize(16, 40, 32, 64, 32, tile=70_000)
"""As in test_verilog.py, whose build it shares."""


def tiles_under(program, chunks):
    """Tiles of the board under a program without its resets, at the edges at which they are
    seen: a clock after they were computed."""
    board, parts = System(program.geometry), []
    for number in range(chunks):
        chunk = program.chunk(number, board.clock)
        writes = [w for w in chunk.writes if w.address != ADDRESS["ctrl_reset"]]
        parts.append(board.run(chunk.stop - board.clock, writes))
    tiles = np.concatenate(parts)
    tiles["clock"] += 1
    return tiles, board.clock + 1


def groups_of(tiles):
    """[(first cycle, words)] of each group of frames, in order. Frames, and rows of a frame, that
    do not follow one another begin a group anew."""
    groups, before = [], None
    for tile in tiles:
        frame, row = int(tile["frame"]), int(tile["row"])
        first = frame - frame % SIZE.cycles
        follows = before is not None and (
            frame == before[0] + 1 or (frame == before[0] and row >= before[1])
        )
        if not follows or groups[-1][0] != first:
            groups.append(
                (first, np.zeros((SIZE.cycles // 32, SIZE.rows, SIZE.columns), np.uint32))
            )
        before = frame, row
        w, b = divmod(frame - first, 32)
        begin = int(tile["tile"]) * SIZE.lanes
        wide = min(SIZE.lanes, SIZE.columns - begin)
        bits = int(tile["bits"]) >> np.arange(wide) & 1
        groups[-1][1][w, row, begin : begin + wide] |= (bits << b).astype(np.uint32)
    return groups


def check(chunks, seed, verilog=False):
    program = lockstep.Program(rows=SIZE.rows, columns=SIZE.columns, lanes=SIZE.lanes, seed=seed)
    tiles, clocks = tiles_under(program, chunks)
    ready = random_ready(clocks + 2000, 0.7, seed)
    encoder = EventEncoder(SIZE)
    out = encoder.run(tiles, ready)
    if verilog:
        assert not unequal(VerilatedEncoder(SIZE).run(tiles, ready), out)
    packets = packets_in(out[: int(np.append(0, np.flatnonzero(out["last"]) + 1)[-1])])
    groups, spikes = iter(groups_of(tiles)), 0
    for packet in packets:  # groups that were lost as a whole have none
        gaps = gaps_of(packet.data, SIZE.cycles)
        assert any(
            first == packet.first and encode_events(words, SIZE.cycles, gaps) == packet.data
            for first, words in groups
        ), f"packet at {packet.first}"
        spikes += len(packet.data)
    return packets, spikes


def test_packets_are_the_coders_under_writes_of_registers():
    packets, spikes = check(60, seed=1, verilog=not missing())
    assert len(packets) > 20
    assert spikes > 10_000
    assert any(a.first >= b.first for a, b in itertools.pairwise(packets))  # cleared


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 12))
def test_more_programs(seed):
    packets, _ = check(200, seed)
    assert len(packets) > 50
