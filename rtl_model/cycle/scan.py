"""The row scan, compiled by numba: frames, passes of a reading and tiles between two changes of a
register.

`tests/rtl_model/cycle/edge_by_edge.py` computes the same in numpy, edge by edge.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Registers, in the order of the array `registers`.
RUN, THRESHOLD, CLOCK_SELECT, RULE, ROWS, COLUMNS, TICK, PATTERN, LEVEL = range(9)
REGISTERS: tuple[str, ...] = (
    "sensor_run",
    "sensor_threshold",
    "sensor_clock_select",
    "sensor_reset_rule",
    "sensor_rows",
    "sensor_columns",
    "sensor_tick_clocks",
    "sensor_pattern",
    "sensor_level",
)

# State, in the order of the array `state`: of the frame in progress (edges START to END, sampled
# settings, next tile) and counters.
ACTIVE, START, END, SELECT, TOP, BOTTOM, LEFT, RIGHT, ROW, INDEX = range(10)
FRAMES, ROWS_READ, SPIKES, CLEAR = range(10, 14)
LAST, LAST_SPIKES, LAST_ENDS = range(14, 17)  # edge of the last tile, its spikes, if it ends a row
# Of the reading: n of the next one, passes that have not begun, number of the pass in progress (0
# in a frame), whether it takes the charges as 0, and in 1/128 e the height of its ramp and a step.
REQUEST, PASSES, PASS, FRESH, RAMP, STEP = range(17, 23)
STATE = 23


@njit(cache=True, nogil=True)
def _begin(registers, state, charge, clock, tick_minimum, q):  # type: ignore[no-untyped-def]
    state[ACTIVE] = 1
    state[START] = clock
    state[SELECT] = registers[CLOCK_SELECT]
    state[END] = clock + (max(registers[TICK], tick_minimum) << state[SELECT])
    state[TOP], state[BOTTOM] = registers[ROWS] & 0xFFFF, registers[ROWS] >> 16
    state[LEFT], state[RIGHT] = registers[COLUMNS] & 0xFFFF, registers[COLUMNS] >> 16
    state[ROW] = state[INDEX] = 0
    state[FRESH] = state[CLEAR]
    if state[PASSES]:
        state[PASSES] -= 1
        state[PASS] += 1
        state[RAMP] += state[STEP]
        return
    if state[REQUEST]:
        state[PASSES] = (1 << state[REQUEST]) - 2
        state[PASS] = 1
        state[STEP] = q << (7 - state[REQUEST])
        state[RAMP] = state[STEP] - 1  # a charge above its whole electrons is at or above a step
        state[REQUEST] = 0
        return
    state[PASS] = 0
    if state[CLEAR]:
        state[CLEAR] = state[FRAMES] = state[ROWS_READ] = state[SPIKES] = 0
        charge[:] = 0
    state[FRAMES] = (state[FRAMES] + 1) & 0xFFFFFFFF


@njit(cache=True, nogil=True)
def _electrons(registers, frame, row, first, out):  # type: ignore[no-untyped-def]
    """Fills `out` (uint8) with the electrons in a tick of pixels first, first + 1, ... of a row.

    It applies to the patterns that do not use the memory.
    """
    pattern, level = registers[PATTERN], registers[LEVEL]
    if pattern == 1:
        out[:] = level
    elif pattern == 2:
        start = level + row + first + frame
        for j in range(out.size):
            out[j] = (start + j) & 255
    else:
        odd = (row ^ first ^ frame) & 1
        for j in range(out.size):
            out[j] = level if (odd ^ j) & 1 else 0


@njit(cache=True, nogil=True)
def _tick(charge, base, electrons, offset, shift, q, rule):  # type: ignore[no-untyped-def]
    """One tick of 32 pixels; returns the spikes as bits.

    Adds `electrons` (uint8) from index `offset` on to `charge` (int32) from index `base` on. The
    constant number of pixels and the check of the indices let the compiler vectorise the loop,
    which is 2.4 times as fast as a loop over slices.
    """
    bits = np.uint32(0)
    if base < 0 or offset < 0:
        return bits
    zero, twice = np.int32(0), np.int32(2 * q)
    hard = rule == 1
    second = np.int32(8191) if rule == 1 or rule == 2 else twice  # above any sum: never
    for j in range(32):
        total = np.int32(charge[base + j] + (np.int32(electrons[offset + j]) << shift))
        fired = total >= q
        less = q if fired else zero
        less = total if fired and hard else less
        less = twice if total >= second else less
        charge[base + j] = min(np.int32(total - less), np.int32(4095))
        bits = np.uint32(bits | np.uint32(np.uint32(fired) << np.uint32(j)))
    return bits


@njit(cache=True, nogil=True)
def _above(state, charge, row, first, lanes):  # type: ignore[no-untyped-def]
    """The pixels of a tile whose charge is above the ramp, as bits."""
    bits, height = np.uint64(0), 4095 if state[FRESH] else state[RAMP] >> 7
    for j in range(lanes):
        bits |= np.uint64(charge[row, first + j] > height) << np.uint64(j)
    return bits


@njit(cache=True, nogil=True)
def _ones(bits):  # type: ignore[no-untyped-def]
    """Counts the ones of 64 bits, in pairs, nibbles and bytes."""
    bits -= (bits >> np.uint64(1)) & np.uint64(0x5555555555555555)
    pairs = np.uint64(0x3333333333333333)
    bits = (bits & pairs) + ((bits >> np.uint64(2)) & pairs)
    bits = (bits + (bits >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((bits * np.uint64(0x0101010101010101)) >> np.uint64(56))


@njit(cache=True, nogil=True)
def scan(  # type: ignore[no-untyped-def]
    registers, state, charge, memory, lanes, columns, row_clocks, tick_minimum, clock, stop, out
):
    """Runs edges `clock` to `stop` - 1; returns the number of tiles written to `out`.

    The arguments are separate because a record would have to be built for every call.

    Args:
        registers: (9,) int64.
        state: (STATE,) int64, updated.
        charge: (rows, lanes * tiles) int32, updated.
        memory: pattern memory, (rows, lanes * tiles) uint8.
        lanes, columns, row_clocks, tick_minimum: lanes, columns, clocks of a row and shortest tick
            of the build.
        clock, stop: edges.
        out: (n,) `TILE`, large enough.
    """
    rows, wide = charge.shape
    tiles = wide // lanes
    count_out = 0
    all_charge, all_memory = charge.reshape(-1), memory.reshape(-1)
    electrons = np.zeros(32, np.uint8)
    q = np.int32(255 + 256 * registers[THRESHOLD])
    while clock < stop:
        if state[ACTIVE] == 0 or clock >= state[END]:
            state[ACTIVE] = 0
            if registers[RUN] == 0 and state[PASSES] == 0 and state[REQUEST] == 0:
                break
            _begin(registers, state, charge, clock, tick_minimum, q)
            clock += 1
            continue
        if state[ROW] >= rows:
            clock = min(stop, state[END])
            continue
        row, tile = state[ROW], state[INDEX]
        edge = state[START] + 1 + row * row_clocks + tile
        if edge >= stop:
            break
        clock = edge + 1
        first = tile * lanes
        inside = state[TOP] <= row <= state[BOTTOM]
        low = min(max(state[LEFT], first), first + lanes)
        high = max(min(state[RIGHT] + 1, first + lanes, columns), low)
        if not inside:
            if state[PASS] == 0:
                charge[row, first : first + lanes] = 0
        else:
            frame = state[PASS] if state[PASS] else (state[FRAMES] - 1) & 0xFFFFFFFF
            base = row * wide + first
            shift = np.int32(state[SELECT])
            bits = _above(state, charge, row, first, lanes) if state[PASS] else np.uint64(0)
            for lane in range(0, 0 if state[PASS] else lanes, 32):
                at = base + lane
                if registers[PATTERN] == 0:
                    part = _tick(all_charge, at, all_memory, at, shift, q, registers[RULE])
                else:
                    _electrons(registers, frame, row, first + lane, electrons)
                    part = _tick(all_charge, at, electrons, 0, shift, q, registers[RULE])
                bits |= np.uint64(part) << np.uint64(lane)
            if high - low < lanes:  # pixels outside the window are held in reset
                if state[PASS] == 0:
                    charge[row, first:low] = 0
                    charge[row, high : first + lanes] = 0
                for j in range(lanes):
                    if not low <= first + j < high:
                        bits &= ~(np.uint64(1) << np.uint64(j))
            out[count_out].clock = edge
            out[count_out].frame = frame
            out[count_out].row = row
            out[count_out].tile = tile
            out[count_out].bits = bits
            count_out += 1
            if state[PASS] == 0:
                count = _ones(bits)
                state[SPIKES] = (state[SPIKES] + count) & 0xFFFFFFFF
                state[LAST], state[LAST_SPIKES], state[LAST_ENDS] = edge, count, tile == tiles - 1
        state[INDEX] += 1
        if state[INDEX] == tiles:
            state[INDEX] = 0
            state[ROW] += 1
            if inside and state[PASS] == 0:
                state[ROWS_READ] = (state[ROWS_READ] + 1) & 0xFFFFFFFF
    return count_out
