"""The code `event`: first spikes as words of 16 bits, in the order in which a chip finds them.

A board sends these packets (docs/event-path.md), so every word depends on what came before it only.
The first spikes are those of `repeat` (trains.py), anew in each packet, in order of cycle, row and
column. Words are little-endian:

    15  14..0
     1  closing (1), tau - 1 (7), column (7)      a first spike, or a closing one
     0  0, cycle (7), row (7)                     cycle and row of the events that follow
     0  1, cycle (7), row (7)                     a gap: from this row on nothing was read
     0  1, cycle (7), row (7)                     after a gap: from this row on it was read again

A row word stands before the first event of a cycle and row. Closing spikes stand last; their cycle
is the last one of the packet. A gap without an end lasts to the end of the packet. Rows in a gap
have no spikes: a decoder knows these places, but not what was there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.viform import Words, words_for
from sensor.codec.columns import Damaged
from sensor.codec.follow import FOLLOW_STATE, follow
from sensor.codec.packets.packet import HEADER, Layer, Packet

MOST_EVENT_CYCLES: Final = 128
"""Cycles of a packet at most, as a width has seven bits."""
SIDE: Final = 128
"""Rows and columns of a tile at most."""
_CRC: Final = 4
"""Bytes of the checksum."""
Halves = npt.NDArray[np.uint16]


class Gap(NamedTuple):
    """Rows of a packet that were not read.

    Attributes:
        cycle, row: the first one.
        end_cycle, end_row: the first one that was read again; (cycles, 0) for none.
    """

    cycle: int
    row: int
    end_cycle: int
    end_row: int


class Event:
    """The code, for `StreamCode`; without gaps."""

    layers = 1

    def encode(self, words: Words, cycles: int) -> list[Layer]:
        """As `TileCode.encode`."""
        spikes = int(np.bitwise_count(words).sum(dtype=np.int64))
        return [Layer(encode_events(words, cycles), spikes, float(spikes))]

    def decode(self, layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> Words:
        """As `TileCode.decode`. Rows in gaps have no spikes."""
        halves = _halves(layers[0])
        across = np.zeros((shape[0] * shape[1], words_for(cycles)), np.uint32)
        state = np.zeros((shape[0] * shape[1], 3), np.int32)
        if cycles > MOST_EVENT_CYCLES or not _draw(halves, *shape, cycles, state, across):
            raise Damaged("events that cannot be")
        return np.ascontiguousarray(across.T).reshape(-1, *shape)


def encode_events(words: Words, cycles: int, gaps: Sequence[Gap] = ()) -> bytes:
    """The data of a packet.

    Args:
        words: (n, H, W) uint32, H and W at most 128; their bits in gaps are taken as 0.
        cycles: cycles of the packet, 1 to 128.
        gaps: gaps in order, without an overlap.

    Raises ValueError for more cycles, rows or columns.
    """
    n, height, width = words.shape
    if max(height, width) > SIDE or not 1 <= cycles <= MOST_EVENT_CYCLES:
        raise ValueError(
            f"a packet of events must have at most {SIDE} x {SIDE} pixels and "
            f"{MOST_EVENT_CYCLES} cycles, not {height} x {width} and {cycles}"
        )
    places = np.array([tuple(gap) for gap in gaps], np.int64).reshape(-1, 4)
    across = words.reshape(n, -1).T.copy()
    if len(places):
        _cut(across, width, places)
    state = np.zeros((len(across), FOLLOW_STATE), np.int32)
    state[:, 0], state[:, 2] = -1, 1
    room = int(np.bitwise_count(across).sum(dtype=np.int64)) + len(across)
    records = np.empty((4, room), np.int32)
    count = follow(across, 0, cycles, state, 0.0, 0.0, 0, records)
    out = np.empty(2 * count + 2 * len(places), np.uint16)
    size = _to_halves(np.ascontiguousarray(records[:, :count]), width, cycles, places, out)
    return out[:size].astype("<u2").tobytes()


def packet_of_line(data: bytes) -> Packet:
    """The packet of the bytes that a board sends: its checksum stands last there, as it is known
    last. Raises Damaged for bytes that are none."""
    if len(data) < HEADER:
        raise Damaged("a packet that is cut off")
    head = HEADER - _CRC
    return Packet.of(data[:head] + data[-_CRC:] + data[head:-_CRC])


def _halves(data: bytes) -> Halves:
    if len(data) % 2:
        raise Damaged("half a word of events")
    return np.frombuffer(data, "<u2").astype(np.uint16)


@njit(cache=True, nogil=True)
def _cut(across, width, gaps):  # type: ignore[no-untyped-def]
    """Clears the spikes in gaps, of (pixels, n) words."""
    for p in range(across.shape[0]):
        row = p // width
        for g in range(gaps.shape[0]):
            first = gaps[g, 0] + (1 if row < gaps[g, 1] else 0)
            stop = gaps[g, 2] + (1 if row < gaps[g, 3] else 0)
            for t in range(first, min(stop, 32 * across.shape[1])):
                across[p, t >> 5] &= ~np.uint32(1 << (t & 31))


@njit(cache=True, nogil=True)
def _to_halves(records, width, cycles, gaps, out):  # type: ignore[no-untyped-def]
    """Records of `follow`, (4, n) pixel by pixel, as words in order of time; their number."""
    begin = np.zeros(cycles + 2, np.int64)
    for i in range(records.shape[1]):
        begin[records[1, i] + 1] += 1
    for t in range(cycles + 1):
        begin[t + 1] += begin[t]
    order = np.empty(records.shape[1], np.int64)
    for i in range(records.shape[1]):  # stable: pixels stay in order
        t = records[1, i]
        order[begin[t]] = i
        begin[t] += 1
    n, gap, before = 0, 0, -1
    for i in order:
        t, row = records[1, i], records[0, i] // width
        place = SIDE * np.int64(t) + row
        while gap < gaps.shape[0] and SIDE * gaps[gap, 2] + gaps[gap, 3] <= place:
            n = _put_gap(gaps[gap], cycles, out, n)
            gap += 1
        closing = t == cycles
        if place != before:
            out[n] = (t - (1 if closing else 0)) << 7 | row
            n += 1
            before = place
        tau = records[2, i] - 1
        out[n] = 0x8000 | (0x4000 if closing else 0) | tau << 7 | records[0, i] % width
        n += 1
    for g in range(gap, gaps.shape[0]):
        n = _put_gap(gaps[g], cycles, out, n)
    return n


@njit(cache=True, nogil=True)
def _put_gap(gap, cycles, out, n):  # type: ignore[no-untyped-def]
    """Appends the words of a gap at place n; the place after them."""
    out[n] = 0x4000 | gap[0] << 7 | gap[1]
    if gap[2] == cycles:
        return n + 1
    out[n + 1] = 0x4000 | gap[2] << 7 | gap[3]
    return n + 2


@njit(cache=True, nogil=True)
def _draw(halves, height, width, cycles, state, across):  # type: ignore[no-untyped-def]
    """Draws the spikes of words; whether they are such as `_to_halves` makes.

    state: (pixels, 3) int32 zeros: last first spike plus 1, its width, whether it was closed.
    across: (pixels, n) uint32 zeros.
    """
    least, place = np.int64(0), np.int64(-1)  # where the next row may be, and where this one is
    column, cycle_of, row_of, in_gap, used = np.int64(-1), np.int64(0), np.int64(0), False, True
    for i in range(halves.size):
        h = np.int64(halves[i])
        high, low = h >> 7 & 127, h & 127
        if h < 0x8000:
            if high >= cycles or low >= height or not used:
                return False
            if h < 0x4000:
                row_of, cycle_of, used = low, high, False
                continue
            if SIDE * high + low < least:
                return False
            in_gap = not in_gap
            least = SIDE * high + low + (1 if in_gap else 0)
            continue
        closing = h & 0x4000 != 0
        here = SIDE * (cycles if closing else cycle_of) + row_of
        if used:
            if here != place:
                return False
        else:
            if here < least or (in_gap and not closing) or (closing and cycle_of != cycles - 1):
                return False
            place, least, column, used = here, here + 1, np.int64(-1), True
        if low <= column or low >= width:
            return False
        column = low
        t, tau, p = cycles if closing else cycle_of, high + 1, row_of * width + low
        last, step = np.int64(state[p, 0]) - 1, np.int64(state[p, 1])
        start = t - tau
        if state[p, 2] or start < last or tau == step or (step == 0 and (start != -1 or closing)):
            return False
        if step and (start - last) % step:
            return False
        if step:
            _repeat(across, p, last, step, start)
        if not closing:
            across[p, t >> 5] |= np.uint32(1 << (t & 31))
        state[p, 0], state[p, 1], state[p, 2] = t + 1, tau, 1 if closing else 0
    if not used:
        return False
    for p in range(across.shape[0]):
        if state[p, 1] and not state[p, 2]:
            _repeat(across, p, np.int64(state[p, 0]) - 1, np.int64(state[p, 1]), cycles - 1)
    return True


@njit(cache=True, nogil=True)
def _repeat(across, p, last, step, stop):  # type: ignore[no-untyped-def]
    """Spikes of a pixel after `last`, every `step` cycles, up to `stop`."""
    for t in range(last + step, stop + 1, step):
        across[p, t >> 5] |= np.uint32(1 << (t & 31))
