"""The event encoder, clock by clock, compiled: what `viform_event_encoder` does at every edge.

Names and sizes are those of the Verilog and its parameters. A clock is computed from the registers
before the edge, and all registers change at its end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from rtl_model.cycle import Tiles
from sensor.codec.bits import lowest_bit

Output = npt.NDArray[np.void]
Ready = npt.NDArray[np.uint8]
CODE = 4
"""Number of the code `event` in packets."""
OUTPUT = np.dtype([("clock", "<u8"), ("data", "<u2"), ("last", "u1")], align=True)
"""A word that has left: the edge at which it did, its bits, and whether it ends a packet."""
_TILE, _GAP, _PLACE = range(3)
_CLEAN, _RUN, _HEAD, _SWEEP, _TAIL = range(5)
# Registers of the queue, in the order of the array `state`; E_*: the tile that came a clock before.
LOST, SEEN, TAKING, JUMPED, LAST_FRAME, PLACED_GROUP, LEVEL, PUT, GET = range(9)
LOST_ROWS, LOST_SPIKES, E_DUE, E_CYCLE, E_ROW, E_INDEX, E_BITS, VALID = range(9, 17)
# Of the packet and its gaps; D_*: the pixel that was read a clock before; M_*: of the stream.
PHASE, STEP, OPEN, PLACED, IN_GAP, GAP_SAID, GROUP, CRC = range(17, 25)
SERVED, SWEEP_ROW, SWEEP_COLUMN, SWEPT = range(25, 29)
DUE, D_SWEEP, D_CYCLE, D_ROW, D_COLUMN, D_PIXEL = range(29, 35)
SAID, SAID_SWEEP, SAID_CYCLE, SAID_ROW = range(35, 39)
M_VALID, M_DATA, M_LAST, LAST_ROW = range(39, 43)
STATE = 43


class EventSize(NamedTuple):
    """Parameters of `viform_event_encoder` and `viform_event_decoder`.

    Attributes:
        rows, columns: rows and columns of pixels, 1 to 128.
        lanes: pixels of a tile that comes in one clock, 32 or 64.
        cycles: cycles of a packet, 32, 64 or 128.
        depth: entries of the queue, a power of two.
        tile: number of the array in the packets.
    """

    rows: int = 32
    columns: int = 32
    lanes: int = 32
    cycles: int = 128
    depth: int = 256
    tile: int = 0

    @property
    def tiles(self) -> int:
        """Tiles of `lanes` pixels in a row."""
        return -(-self.columns // self.lanes)

    @property
    def row_clocks(self) -> int:
        """Clocks from a row's first tile to that of the next, as in `viform_board`."""
        return self.tiles * self.lanes // 32 + 4

    @property
    def tick_minimum(self) -> int:
        """Shortest frame of such an array, clocks."""
        return self.rows * self.row_clocks + 4

    @property
    def pixels(self) -> int:
        """Pixels of the array."""
        return self.rows * self.columns

    @property
    def verilog(self) -> dict[str, int]:
        """Parameters of the Verilog by name."""
        return {
            "ROWS": self.rows,
            "COLUMNS": self.columns,
            "LANES": self.lanes,
            "CYCLES": self.cycles,
            "DEPTH": self.depth,
            "TILE": self.tile,
        }


def _table() -> npt.NDArray[np.int64]:
    """CRC-32C of every byte, reflected (RFC 3720, B.4)."""
    table = np.arange(256, dtype=np.int64)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ 0x82F63B78, table >> 1)
    return table


CRC_TABLE = _table()


class EventEncoder:
    """The encoder after reset, at clock 0.

    Attributes:
        size: size of the build.
        clock: edges passed.
    """

    def __init__(self, size: EventSize) -> None:
        self.size, self.clock = size, 0
        self._state = np.zeros(STATE, np.int64)
        self._state[[LOST, IN_GAP]] = 1  # the stream begins as after a loss
        self._queue = np.zeros((size.depth + 1, 5), np.int64)  # kind, cycle, row, index, bits
        self._pixels = np.zeros((size.rows * size.tiles * size.lanes, 3), np.int64)

    @property
    def lost_rows(self) -> int:
        """Number of rows that found no room in the queue."""
        return int(self._state[LOST_ROWS])

    @property
    def lost_spikes(self) -> int:
        """Number of spikes in the lost rows."""
        return int(self._state[LOST_SPIKES])

    def run(self, tiles: Tiles, ready: Ready) -> Output:
        """Runs as many clocks as `ready` has; returns the words that left.

        Args:
            tiles: `TILE`s of these clocks, in order; each is seen at the edge `clock`.
            ready: (n,) 0 or 1: `m_tready` in each clock.
        """
        out = np.empty(len(ready), OUTPUT)
        size = self.size
        count = _run(
            self._state, self._queue, self._pixels, CRC_TABLE,
            (size.rows, size.columns, size.lanes, size.tiles, size.cycles, size.tile),
            tiles, ready, self.clock, out,
        )  # fmt: skip
        self.clock += len(ready)
        return out[:count]


@njit(cache=True, nogil=True)
def _lane(bits):  # type: ignore[no-untyped-def]
    """Place of the lowest one."""
    low = bits & 0xFFFFFFFF
    return lowest_bit(low) if low else 32 + lowest_bit((bits >> 32) & 0xFFFFFFFF)


@njit(cache=True, nogil=True)
def _run(s, queue, pixels, table, size, tiles, ready, clock, out):  # type: ignore[no-untyped-def]
    """Runs ready.size clocks from `clock` on; the number of words that left.

    s: (STATE,) int64. queue: (depth + 1, 5) int64, the last its head. pixels: (n, 3) int64,
    whether a pixel has fired in this packet, cycle of its last spike, width - 1. All three are
    changed.
    """
    rows, columns, lanes, row_tiles, cycles, number = size
    depth, wide, shift = queue.shape[0] - 1, row_tiles * lanes, lowest_bit(cycles)
    following_tile, count = 0, 0
    for n in range(ready.size):
        phase, step, due, swept = s[PHASE], s[STEP], s[DUE] != 0, s[SWEPT] != 0
        m_free = s[M_VALID] == 0 or ready[n] != 0
        if s[M_VALID] and ready[n]:
            out[count].clock = clock + n
            out[count].data = s[M_DATA]
            out[count].last = s[M_LAST]
            count += 1
        entry_valid, kind, cycle, row = s[VALID] != 0, -1, 0, 0
        index, bits = np.int64(0), np.int64(0)
        if entry_valid:
            kind, cycle, row = queue[depth, 0], queue[depth, 1], queue[depth, 2]
            index, bits = queue[depth, 3], queue[depth, 4]

        # The pixel that was read a clock before.
        width, send, row_said = np.int64(0), False, False
        if due:
            fired, held = pixels[s[D_PIXEL], 0] != 0, pixels[s[D_PIXEL], 2]
            width = s[D_CYCLE]
            if fired:
                width -= pixels[s[D_PIXEL], 1] + (0 if s[D_SWEEP] else 1)
            if phase != _CLEAN:
                send = (fired and held < width) if s[D_SWEEP] else (not fired or held != width)
            row_said = (
                s[SAID] != 0 and s[SAID_SWEEP] == s[D_SWEEP]
                and s[SAID_CYCLE] == s[D_CYCLE] and s[SAID_ROW] == s[D_ROW]
            )  # fmt: skip
        decided = due and (not send or (row_said and m_free))

        # The pixel that is read now.
        sweeps = phase in (_SWEEP, _CLEAN)
        left = bits & ~s[SERVED]
        only = left & (left - 1) == 0
        serve = phase == _RUN and kind == _TILE and (not due or (decided and s[SERVED] != 0))
        look = sweeps and not swept and (not due or decided)

        # Gaps and places.
        rest = phase == _RUN and not due
        is_gap, is_place = rest and kind == _GAP, rest and kind == _PLACE
        opened = is_place and s[OPEN] != 0
        here = opened and (s[PLACED] != 0 or (index == 0 and bits >> shift == s[GROUP]))
        start = cycle == 0 and row == 0
        resume = here and s[IN_GAP] != 0 and not (start and s[GAP_SAID] == 0)
        say_gap = resume or (is_gap and index == 0)
        done_gap = is_gap and (index != 0 or m_free)
        done_place = here and (not resume or (s[GAP_SAID] != 0 and m_free))
        take = (serve and only) or done_gap or done_place

        # The word of this clock.
        body = (due and send) or say_gap or phase == _HEAD
        puts = (body or phase == _TAIL) and m_free
        word = np.int64(0)
        if puts:
            if phase == _TAIL:
                word = ((s[CRC] ^ 0xFFFFFFFF) >> (16 * (step & 1))) & 0xFFFF
            elif phase == _HEAD:
                if step < 2:
                    word = np.int64(cycles if step else CODE)
                else:
                    field = number if step < 4 else s[GROUP] << (shift - 5)
                    word = (np.int64(field) >> (16 * (step & 1))) & 0xFFFF
            elif say_gap:
                word = np.int64(0x4000)
                if is_gap or s[GAP_SAID]:
                    word |= cycle << 7 | row
            elif row_said:
                word = 0x8000 | s[D_SWEEP] << 14 | width << 7 | s[D_COLUMN]
            else:
                word = s[D_CYCLE] << 7 | s[D_ROW]

        # A tile comes in.
        valid = following_tile < tiles.size and np.int64(tiles[following_tile].clock) == clock + n
        first, taken, loss, place = False, False, False, False
        jump, room, fresh = False, False, False
        frame, tile_row, tile_index = np.int64(0), np.int64(0), np.int64(0)
        tile_bits, begin_frame, begin_row = np.int64(0), np.int64(0), np.int64(0)
        if valid:
            tile = tiles[following_tile]
            following_tile += 1
            frame, tile_row = np.int64(tile.frame), np.int64(tile.row)
            tile_index, tile_bits = np.int64(tile.tile), np.int64(tile.bits)
            first, taken = tile_index == 0, s[TAKING] != 0
        if first:
            next_frame = (s[LAST_FRAME] + 1) & 0xFFFFFFFF
            follows = frame == next_frame or (frame == s[LAST_FRAME] and tile_row > s[LAST_ROW])
            jump = s[SEEN] != 0 and not follows
            if s[LOST]:
                room = s[LEVEL] <= depth // 2
            else:
                room = s[LEVEL] <= depth - row_tiles - 2 and not jump
            taken, loss = room, not room and s[LOST] == 0
            lies = loss and jump  # from the frame that should have come
            begin_frame = next_frame if lies else frame
            begin_row = np.int64(0) if lies else tile_row
            fresh = begin_frame >> shift != s[PLACED_GROUP]
            place = room and (s[LOST] != 0 or fresh)
        push = loss or place or s[E_DUE] != 0
        fetch = s[LEVEL] != 0 and (not entry_valid or take)

        # The edge: the pixel's memory, the stream, the packet.
        if m_free:
            s[M_VALID], s[M_LAST] = puts, phase == _TAIL and step & 1 == 1
            if puts:
                s[M_DATA] = word
        if puts and body:
            crc = s[CRC] ^ word
            crc = (crc >> 8) ^ table[crc & 255]
            s[CRC] = (crc >> 8) ^ table[crc & 255]
        if decided:
            pixel = s[D_PIXEL]
            pixels[pixel, 0] = 0 if s[D_SWEEP] else 1
            pixels[pixel, 1] = 0 if s[D_SWEEP] else s[D_CYCLE]
            pixels[pixel, 2] = 0 if s[D_SWEEP] else width
            s[DUE] = 0
        elif due and m_free and not row_said:
            s[SAID], s[SAID_SWEEP] = 1, s[D_SWEEP]
            s[SAID_CYCLE], s[SAID_ROW] = s[D_CYCLE], s[D_ROW]
        if serve:
            column = index * lanes + _lane(left)
            s[DUE], s[D_SWEEP], s[D_CYCLE], s[D_ROW] = 1, 0, cycle, row
            s[D_COLUMN], s[D_PIXEL] = column, row * wide + column
            s[SERVED] = 0 if only else s[SERVED] | (left & -left)
        if look:
            s[DUE], s[D_SWEEP], s[D_CYCLE], s[D_ROW] = 1, 1, cycles - 1, s[SWEEP_ROW]
            s[D_COLUMN], s[D_PIXEL] = s[SWEEP_COLUMN], s[SWEEP_ROW] * wide + s[SWEEP_COLUMN]
            s[SWEEP_COLUMN] += 1
            if s[SWEEP_COLUMN] == columns:
                s[SWEEP_COLUMN] = 0
                s[SWEEP_ROW] += 1
                if s[SWEEP_ROW] == rows:
                    s[SWEEP_ROW], s[SWEPT] = 0, 1
        if sweeps:
            if swept and not due:
                s[PHASE], s[STEP], s[SWEPT] = _RUN if phase == _CLEAN else _TAIL, 0, 0
        elif phase != _RUN:
            if m_free:
                s[STEP] += 1
                if phase == _HEAD and step == 5:
                    s[PHASE] = _RUN
                if phase == _TAIL and step == 1:
                    s[PHASE], s[OPEN] = _RUN, 0
        elif is_place and not opened:
            s[PHASE], s[STEP], s[OPEN], s[PLACED], s[GAP_SAID], s[SAID] = _HEAD, 0, 1, 1, 0, 0
            s[GROUP], s[CRC] = bits >> shift, 0xFFFFFFFF
        elif opened and not here:
            s[PHASE] = _SWEEP
        else:
            if say_gap and m_free:
                s[GAP_SAID] = 1
            if done_gap:
                s[IN_GAP] = 1
                if index:
                    s[GAP_SAID] = 0
            if done_place:
                s[PLACED] = s[IN_GAP] = 0

        # The queue.
        if push:
            to = s[PUT]
            if loss or place:
                queue[to, 0], queue[to, 1] = _PLACE if place else _GAP, begin_frame % cycles
                queue[to, 2], queue[to, 4] = begin_row, begin_frame
                queue[to, 3] = (s[JUMPED] != 0 or jump) if place else fresh
            else:
                queue[to, 0], queue[to, 1], queue[to, 2] = _TILE, s[E_CYCLE], s[E_ROW]
                queue[to, 3], queue[to, 4] = s[E_INDEX], s[E_BITS]
            s[PUT] = (to + 1) % depth
        if fetch:
            for i in range(5):  # the head has a place of its own, as in the memory's register
                queue[depth, i] = queue[s[GET], i]
            s[GET] = (s[GET] + 1) % depth
        s[LEVEL] += np.int64(push) - np.int64(fetch)
        s[VALID] = fetch or (entry_valid and not take)
        s[E_DUE] = valid and taken and tile_bits != 0
        if valid:
            s[E_CYCLE], s[E_ROW], s[E_INDEX] = frame % cycles, tile_row, tile_index
            s[E_BITS] = tile_bits
            if not taken:
                ones = 0
                while tile_bits:
                    tile_bits &= tile_bits - 1
                    ones += 1
                s[LOST_SPIKES] = (s[LOST_SPIKES] + ones) & 0xFFFFFFFF
        if place:
            s[PLACED_GROUP] = frame >> shift
        if first:
            s[JUMPED] = not room and (s[JUMPED] != 0 or jump)
            s[TAKING], s[SEEN], s[LOST] = room, 1, not room
            s[LAST_FRAME], s[LAST_ROW] = frame, tile_row
            if not room:
                s[LOST_ROWS] = (s[LOST_ROWS] + 1) & 0xFFFFFFFF
    return count
