"""The event decoder, clock by clock, compiled: what `viform_event_decoder` does at every edge.

Names are those of the Verilog. A clock is computed from the registers before the edge, and all
registers change at its end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from rtl_model.events.encoder import CODE, CRC_TABLE, EventSize, Output, Ready

SPIKES = np.dtype(
    [
        ("clock", "<u8"), ("data", "<u4"), ("first", "<u4"), ("tile", "<u4"), ("last", "u1"),
        ("gaps", "u1"),
    ],
    align=True,
)  # fmt: skip
"""A word that has left: the edge at which it did, the spikes of a pixel in 32 cycles, the packet's
first cycle / 32 and its tile, whether it ends a packet, and whether the packet has gaps."""
GAP = np.dtype([("clock", "<u8"), ("place", "<u2")], align=True)
"""A place of a gap: the clock in which it is shown, and 128 times its cycle plus its row."""

_TAKE, _LOOK, _FILL, _LOAD, _NEXT, _FLUSH, _EMIT = range(7)
# Registers, in the order of the array `state`: of the packet that comes in,
PHASE, NEWEST, NEWER, ITEM, HELD, ITEM_VALID, ENDED, SUM, CRC, HEAD = range(10)
BAD, GAPS, KNOWN_ROW, COUNTED, TILE, FIRST, CYCLE, ROW, FINISH = range(10, 19)
# of the pixel,
WORD, SCAN_ROW, SCAN_COLUMN, CURSOR, STOP, STRIDE, AGAIN, OWN = range(19, 27)
BITS, BITS_VALID, BITS_AT, STORED, LAST_FIRED, LAST_CLOSED, LAST_CYCLE, LAST_WIDTH = range(27, 35)
# and of the words that go out.
PENDING, PENDING_LAST, PENDING_AT, SCANNED, M_VALID, M_DATA, M_LAST, M_USER = range(35, 43)
M_FIRST, M_TILE, PACKETS, DAMAGED, OFFERS = range(43, 48)
STATE = 48


class Decoded(NamedTuple):
    """What came out.

    Attributes:
        words: `SPIKES`.
        gaps: `GAP`.
        taken: halves that went in.
    """

    words: npt.NDArray[np.void]
    gaps: npt.NDArray[np.void]
    taken: int


def room_for(
    halves: Output, offered: Ready, ready: Ready, size: EventSize
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.void]]:
    """Room for the words and the gaps that halves can give, one packet before them included.
    Raises ValueError for `offered` and `ready` of different lengths."""
    if len(offered) != len(ready):
        raise ValueError(f"offered must have the {len(ready)} clocks of ready, not {len(offered)}")
    packets = int(halves["last"].sum()) + 1
    return np.empty(packets * size.cycles // 32 * size.pixels, SPIKES), np.empty(len(halves), GAP)


class EventDecoder:
    """The decoder after reset, at clock 0.

    Attributes:
        size: size of the build.
        clock: edges passed.
    """

    def __init__(self, size: EventSize) -> None:
        self.size, self.clock = size, 0
        self._state = np.zeros(STATE, np.int64)
        self._state[PHASE] = _NEXT
        self._state[[FINISH, BAD]] = 1
        self._pixels = np.zeros((size.pixels, 4), np.int64)
        self._memory = np.zeros((size.cycles // 32, size.pixels), np.int64)

    @property
    def packets(self) -> int:
        """Good packets so far."""
        return int(self._state[PACKETS])

    @property
    def damaged(self) -> int:
        """Packets with another checksum, head or place."""
        return int(self._state[DAMAGED])

    def run(self, halves: Output, offered: Ready, ready: Ready, clocks: int, idle: int) -> Decoded:
        """Runs until all halves are taken and `idle` clocks more, at most `clocks` clocks.

        Args:
            halves: words of packets, `data` and `last`, without regard to their clocks.
            offered, ready: (n,) 0 or 1, repeated: whether the next half is offered, and
                `m_tready`.
            clocks, idle: number of clocks.
        """
        words, gaps = room_for(halves, offered, ready, self.size)
        size = (self.size.rows, self.size.columns, self.size.cycles)
        passed, taken, count, places = _run(
            self._state, self._pixels, self._memory, CRC_TABLE, size, halves, offered, ready,
            self.clock, clocks, idle, words, gaps,
        )  # fmt: skip
        self.clock += passed
        return Decoded(words[:count], gaps[:places], taken)


@njit(cache=True, nogil=True)
def _run(  # type: ignore[no-untyped-def]
    s, pixels, memory, table, size, halves, offered, ready, clock, clocks, idle, words, gaps
):
    """Runs; (clocks passed, halves taken, words out, places of gaps).

    s: (STATE,) int64. pixels: (n, 4) int64, whether a pixel has fired in this packet, was closed,
    cycle of its last event, width - 1. memory: (words, n) int64. All three are changed.
    """
    rows, columns, cycles = size
    period, flat = ready.size, memory.reshape(-1)
    last_word = cycles // 32 - 1
    taken, count, places, n, left, offers = 0, 0, 0, 0, idle, False
    while n < clocks and left:
        if taken == halves.size:
            left -= 1
        offers = taken < halves.size and (offers or offered[n % period] != 0)
        is_ready = ready[n % period] != 0
        phase, item, head, finish = s[PHASE], s[ITEM], s[HEAD], s[FINISH] != 0
        bad, item_valid = s[BAD] != 0, s[ITEM_VALID] != 0
        m_free = s[M_VALID] == 0 or is_ready
        if s[M_VALID] and is_ready:
            word = words[count]
            word.clock, word.data, word.first = clock + n, s[M_DATA], s[M_FIRST]
            word.tile, word.last, word.gaps = s[M_TILE], s[M_LAST], s[M_USER]
            count += 1

        # The word that is looked at.
        s_ready = phase == _TAKE and not item_valid and s[ENDED] == 0
        accept = offers and s_ready
        is_body = phase == _TAKE and item_valid and head == 6
        high, low = item >> 7 & 127, item & 127
        is_event = item & 0x8000 != 0
        closing = item & 0x4000 != 0
        place_fits = high < cycles and low < rows
        event_fits = s[KNOWN_ROW] != 0 and low < columns
        if is_body and item >> 14 == 1:
            gaps[places].clock, gaps[places].place = clock + n, item & 0x3FFF
            places += 1

        # The pixel whose last event is read.
        at_row, at_column = s[ROW], low
        if finish:
            at_row, at_column = s[SCAN_ROW], s[SCAN_COLUMN]
        last_pixel = s[SCAN_ROW] == rows - 1 and s[SCAN_COLUMN] == columns - 1
        pixel = at_row * columns + at_column
        begins, limit, repeats = np.int64(0), np.int64(0), False
        if phase == _LOOK:
            begins = s[LAST_CYCLE] + s[LAST_WIDTH] + 1
            if finish:
                limit = np.int64(cycles - 1)
            elif closing:
                limit = (cycles - 1 - high) & 127
            else:
                limit = (s[CYCLE] - high - 1) & 127
            repeats = s[LAST_FIRED] != 0 and s[LAST_CLOSED] == 0 and begins <= limit and not bad

        # Its spikes in 32 cycles.
        again = s[AGAIN] != 0
        target = s[CURSOR] & 127 if again else s[CYCLE]
        target_at = ((target >> 5) % (last_word + 1)) * pixels.shape[0] + pixel
        near = s[BITS_VALID] != 0 and s[BITS_AT] == target_at
        sets = (phase == _FILL and near) or phase == _LOAD
        fetches = phase == _FILL and not near
        write_back = (fetches or phase == _FLUSH) and s[BITS_VALID] != 0
        cursor = s[CURSOR] + s[STRIDE]
        ends = phase == _LOOK and not repeats and (finish or closing)
        if sets:
            ends = not again or (cursor > s[STOP] and s[OWN] == 0)
        sent = phase == _EMIT and s[PENDING] != 0 and (m_free or bad)
        emit = phase == _EMIT and s[SCANNED] == 0 and (s[PENDING] == 0 or sent)
        done = phase == _EMIT and s[SCANNED] != 0 and (s[PENDING] == 0 or sent)
        stored, sent_last = s[STORED], s[PENDING_LAST]

        # The edge: memories.
        if write_back:
            flat[s[BITS_AT]] = s[BITS]
        if sent:
            flat[s[PENDING_AT]] = 0
        emit_at = s[WORD] * pixels.shape[0] + pixel
        if fetches:
            s[STORED] = flat[target_at]
        if emit:
            s[STORED] = flat[emit_at]
        if (is_body and is_event and event_fits) or phase == _NEXT:
            for i in range(4):
                s[LAST_FIRED + i] = pixels[pixel, i]
        if phase == _LOOK:
            pixels[pixel, 0], pixels[pixel, 1] = not finish, not finish and closing
            pixels[pixel, 2] = 0 if finish or closing else s[CYCLE]
            pixels[pixel, 3] = 0 if finish else high

        # Registers.
        if accept:
            s[ITEM], s[NEWER], s[NEWEST] = s[NEWER], s[NEWEST], np.int64(halves[taken].data)
            s[SUM] = s[NEWEST] << 16 | s[NEWER]
            s[ITEM_VALID] = s[HELD] == 2
            s[HELD] = min(s[HELD] + 1, 2)
            s[ENDED] = halves[taken].last
            taken += 1
            offers = False
        if sets:
            s[BITS] = (stored if phase == _LOAD else s[BITS]) | np.int64(1) << (target & 31)
            s[BITS_VALID], s[BITS_AT], s[CURSOR] = 1, target_at, cursor
            if again:
                s[AGAIN] = cursor <= s[STOP]
            else:
                s[OWN] = 0
        if (ends and finish) or emit:
            s[SCAN_COLUMN] += 1
            if s[SCAN_COLUMN] == columns:
                s[SCAN_COLUMN] = 0
                s[SCAN_ROW] = 0 if last_pixel else s[SCAN_ROW] + 1
        if emit:
            s[PENDING_AT], s[PENDING_LAST] = emit_at, last_pixel and s[WORD] == last_word
            if last_pixel:
                s[SCANNED] = s[WORD] == last_word
                s[WORD] += 1
        if emit or sent:
            s[PENDING] = emit
        if m_free:
            s[M_VALID] = sent and not bad
            if sent:
                s[M_DATA], s[M_LAST], s[M_USER] = stored, sent_last, s[GAPS]
                s[M_FIRST], s[M_TILE] = s[FIRST], s[TILE]
        if phase == _TAKE and item_valid:
            s[ITEM_VALID] = 0
            crc = s[CRC] ^ item
            crc = (crc >> 8) ^ table[crc & 255]
            s[CRC] = (crc >> 8) ^ table[crc & 255]
            if head < 6:
                s[HEAD] += 1
                if (head == 0 and item != CODE) or (head == 1 and item != cycles):
                    s[BAD] = 1
                if head > 1:
                    to = TILE if head < 4 else FIRST
                    shift = 16 * (head & 1)
                    s[to] = (s[to] & ~(np.int64(0xFFFF) << shift)) | item << shift
            elif not is_event:
                s[KNOWN_ROW] = not closing and place_fits  # bit 14 of a place is that of a gap
                s[CYCLE], s[ROW] = high, low
                if not place_fits:
                    s[BAD] = 1
                if closing:
                    s[GAPS] = 1
            elif event_fits:
                s[PHASE] = _LOOK
            else:
                s[BAD] = 1
        elif phase == _TAKE and s[ENDED] and not accept:
            s[ENDED], s[HELD], s[FINISH], s[PHASE] = 0, 0, 1, _NEXT
            if head < 6 or s[CRC] ^ 0xFFFFFFFF != s[SUM]:
                s[BAD] = 1
        elif phase == _LOOK:
            s[CURSOR], s[STRIDE], s[STOP] = begins, s[LAST_WIDTH] + 1, limit
            s[AGAIN], s[OWN] = repeats, not finish and not closing
            if not ends:
                s[PHASE] = _FILL
        elif phase == _FILL:
            if not near:
                s[PHASE] = _LOAD
        elif phase == _LOAD:
            s[PHASE] = _FILL
        elif phase == _NEXT:
            s[PHASE] = _LOOK
        elif phase == _FLUSH:
            s[BITS_VALID], s[PHASE] = 0, _EMIT
        elif done:
            if bad:
                s[DAMAGED] += s[COUNTED]
            else:
                s[PACKETS] += 1
            s[PHASE], s[FINISH], s[COUNTED], s[HEAD], s[CRC] = _TAKE, 0, 1, 0, 0xFFFFFFFF
            s[BAD] = s[GAPS] = s[KNOWN_ROW] = s[SCANNED] = s[WORD] = 0
        if ends:
            s[PHASE] = _TAKE if not finish else _FLUSH if last_pixel else _NEXT
        n += 1
    return n, taken, count, places
