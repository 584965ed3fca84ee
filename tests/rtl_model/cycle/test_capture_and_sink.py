"""Capture memory and display sink through their registers."""

import zlib

import numpy as np
import pytest

from rtl_model.cycle import Settings, System, planes
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS

ADDRESS = {register.name: register.address for register in REGISTERS}
ARMED, BUSY, DONE, OVERFLOW = 1, 2, 4, 8
RUNNING, UNDERRUN, LOST = 1, 2, 4
SMALL = Geometry(rows=3, columns=40, lanes=32, clock_hz=4_000_000, capture_words=64, sink_words=16)
WIDE = SMALL._replace(columns=70, lanes=64)


class Board(System):
    """A system with registers by name."""

    def get(self, name):
        return self.read(ADDRESS[name])

    def put(self, name, value):
        self.write(ADDRESS[name], value)

    def drain(self):
        return [self.get("capture_data") for _ in range(self.get("capture_level"))]


def running(geometry, **settings):
    board = Board(geometry)
    for name, value in {"pattern": 2, "level": 90, "threshold": 0, **settings}.items():
        board.put(f"sensor_{name}", value)
    return board


def records(words, geometry):
    """Splits a drained memory into (sequence, frame, row, bits of the row) and checks the CRCs."""
    made = []
    for record in np.array(words, ">u4").reshape(-1, geometry.record_words):
        assert zlib.crc32(record[:-1].tobytes()) == record[-1]
        bits = np.unpackbits(record[2:-1].astype("<u4").view(np.uint8), bitorder="little")
        made.append((int(record[0]), int(record[1]) >> 12, int(record[1]) & 0xFFF, bits))
    return made


def test_crc_is_the_one_with_this_check_value():
    """CRC-32 of "123456789" is 0xCBF43926 (Williams, 1993), for words as for bytes."""
    assert zlib.crc32(b"123456789") == 0xCBF43926
    board = Board(SMALL)
    board.put("sink_run", 1)
    words = [0x31323334, 0x35363738] * 3
    for word in words:
        board.put("sink_data", word)
    board.put("sensor_run", 1)
    board.run(SMALL.tick_minimum)
    assert board.get("sink_crc") == zlib.crc32(b"12345678" * 3)


@pytest.mark.parametrize("geometry", [SMALL, WIDE])
def test_a_burst_holds_the_planes(geometry):
    board = running(geometry)
    board.put("capture_arm", 2)
    assert board.get("capture_state") == ARMED
    board.put("sensor_run", 1)
    board.run(geometry.tick_minimum // 2)
    assert board.get("capture_state") == BUSY
    board.run(3 * geometry.tick_clocks)
    assert board.get("capture_state") == DONE
    assert board.get("capture_rows") == 6 and board.get("capture_lost") == 0
    found = records(board.drain(), geometry)
    truth = planes(geometry, Settings(0, pattern=2, level=90), None, 2)
    assert truth.any()
    for n, (sequence, frame, row, bits) in enumerate(found):
        assert (sequence, frame, row) == (n, *divmod(n, 3))
        np.testing.assert_array_equal(bits[: geometry.columns], truth[frame, row])
        assert not bits[geometry.columns :].any()


def test_rows_that_find_no_room_are_lost_whole_and_counted():
    board = running(SMALL, run=1, rows=2 << 16 | 1)
    board.run(500)
    board.put("capture_arm", 8)  # 16 records of 5 words into 64
    board.run(10 * SMALL.tick_clocks)
    assert board.get("capture_state") == DONE | OVERFLOW
    assert (board.get("capture_rows"), board.get("capture_lost")) == (12, 4)
    first = board.get("sensor_frames")
    found = records(board.drain(), SMALL)
    assert [(sequence, row) for sequence, _, row, _ in found] == [(n, 1 + n % 2) for n in range(12)]
    assert first > found[0][1] > 0
    board.put("capture_arm", 0)
    assert board.get("capture_state") == DONE
    assert board.get("capture_level") == board.get("capture_rows") == 0


def test_the_pointer_goes_back_but_not_beyond_the_end():
    board = running(SMALL, run=1)
    board.put("capture_arm", 1)
    board.run(3 * SMALL.tick_clocks)
    words = board.drain()
    assert len(words) == 15
    assert board.get("capture_data") == 0 and board.get("capture_pointer") == 15
    board.put("capture_pointer", 13)
    assert board.drain() == words[13:]
    board.put("capture_pointer", 1000)
    assert board.get("capture_pointer") == 15


def test_what_the_sink_shows_is_captured_and_comes_back():
    for geometry in (SMALL, WIDE):
        board = Board(geometry)
        rng = np.random.default_rng(4)
        words = [int(word) for word in rng.integers(1 << 32, size=3 * geometry.row_words)]
        for word in words:
            board.put("sink_data", word)
        board.put("capture_source", 1)
        board.put("capture_arm", 1)
        board.put("sink_run", 1)
        assert board.get("sink_level") == len(words) and board.get("sink_state") == RUNNING
        board.put("sensor_rows", 1 << 16 | 1)  # the window is not the sink's
        board.put("sensor_run", 1)
        board.run(3 * geometry.tick_clocks)
        record = geometry.record_words
        shown = np.array(board.drain()).reshape(3, record)[:, 2:-1]
        np.testing.assert_array_equal(shown.reshape(-1), words)
        assert board.get("sink_crc") == zlib.crc32(np.array(words, ">u4").tobytes())
        assert board.get("sink_rows") == 3 and board.get("sink_state") == 0


def test_a_sink_with_too_few_and_too_many_words():
    board = Board(SMALL)
    for word in range(17):
        board.put("sink_data", word)
    assert board.get("sink_state") == LOST and board.get("sink_lost") == 1
    board.put("sink_run", 3)  # 18 words of which 16 are there
    board.put("sensor_run", 1)
    board.run(4 * SMALL.tick_clocks)
    assert board.get("sink_state") == UNDERRUN | LOST
    assert board.get("sink_underruns") == 2 and board.get("sink_rows") == 9
    sent = np.array([*range(16), 0, 0], ">u4")
    assert board.get("sink_crc") == zlib.crc32(sent.tobytes())
    board.put("sink_clear", 1)
    assert board.get("sink_state") == board.get("sink_crc") == board.get("sink_rows") == 0


def test_reset_leaves_the_uptime_and_the_line_and_starts_at_frame_0():
    board = running(SMALL, run=1)
    board.line.rx_bytes = 5
    board.run(5000)
    board.put("capture_arm", 3)
    board.put("ctrl_reset", 1)
    assert board.get("sensor_run") == board.get("capture_state") == 0
    assert board.get("ctrl_uptime") > 5000 and board.get("uart_rx_bytes") == 5
    board.run(3000)
    board.put("sensor_run", 1)
    tiles = board.run(200)
    assert tiles["frame"][0] == 0
