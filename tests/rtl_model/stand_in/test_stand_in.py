"""A board as sensor and as display, over the cycle model behind a port, on lines with and without
duration."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import InputError
from rtl_model.cycle import Bridge, Settings, planes
from rtl_model.geometry import Geometry
from rtl_model.host import Board, LineFault, Uartbone
from rtl_model.stand_in import (
    BoardDisplay,
    BoardSensor,
    OpenBoard,
    finest_level,
    open_board,
    quantise,
)
from rtl_model.stand_in.opening import parse_address
from rtl_model.virtual.ethernet import EthernetBoard
from tests.rtl_model.stand_in.counted import counted_uploads

SMALL = Geometry(rows=5, columns=40, capture_words=128, sink_words=64, baud=3_000_000)


class BridgePort:
    """The cycle model of a board as a port with simulated time.

    Attributes:
        falter: clocks of a single pause of the line, in the middle of the write after next.
    """

    name, baud = "the model", 3_000_000

    def __init__(self, geometry: Geometry, byte_clocks: int | None) -> None:
        self.bridge = Bridge(geometry, byte_clocks=byte_clocks)
        self.clock, self.hz, self._answer = 0, geometry.clock_hz, b""
        self.falter = 0

    def write(self, data: bytes, deadline_s: float = 0.0) -> None:
        cut = 12 if self.falter and data[0] == 3 else len(data)
        for part in (data[:cut], data[cut:]):
            reply = self.bridge.feed(part, self.clock)
            self.clock += len(part) * self.bridge.byte_clocks
            self.clock = max([self.clock, self.bridge.system.clock, *reply.clocks]) + 1
            self._answer += reply.data
            if cut < len(data):
                self.clock += self.falter

    def read(self, wanted: int, deadline_s: float) -> bytes:
        got, self._answer = self._answer[:wanted], self._answer[wanted:]
        if len(got) < wanted:
            self.clock += round(deadline_s * self.hz)
            self.bridge.wait(self.clock)
        return got

    def drain(self) -> bytes:
        got, self._answer = self._answer, b""
        return got

    def set_baud(self, baud: int) -> None:
        self.baud = baud

    def now(self) -> float:
        return self.clock / self.hz

    def close(self) -> None:
        return


def place(geometry: Geometry = SMALL, byte_clocks: int | None = 1) -> OpenBoard:
    board = Board(Uartbone(BridgePort(geometry, byte_clocks)))
    return OpenBoard(board, board.info(), "the model")


@pytest.mark.parametrize("byte_clocks", [1, None])
@pytest.mark.parametrize("reset", ["residual", "hard", "subtract"])
def test_bursts_join_without_a_missing_frame(
    byte_clocks: int | None, reset: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """23 ticks in bursts of 5, then other light, give the planes of one run in numpy."""
    uploads = counted_uploads(monkeypatch)
    rng = np.random.default_rng(3)
    steps = rng.integers(0, 256, (2, 5, 40)).astype(np.uint8)
    sensor = BoardSensor(place(byte_clocks=byte_clocks), 1, reset, 30)
    assert sensor.burst == 128 // (5 * 5)
    taken = np.concatenate([sensor.expose(steps[0], 23), sensor.expose(steps[1], 7)])
    charge = np.zeros((5, 40), np.int64)
    rule = ("residual", "hard", "subtract").index(reset)
    settings = Settings(threshold=1, reset_rule=rule)
    truth = [
        planes(SMALL, settings, light, n, charge) for light, n in zip(steps, (23, 7), strict=True)
    ]
    np.testing.assert_array_equal(taken, np.concatenate(truth))
    assert (sensor.wrong_bits, len(uploads)) == (0, 2)
    assert sensor.bytes == 30 * 5 * 5 * 4


def test_a_pixels_rate_is_its_step_over_the_threshold() -> None:
    """With the residual charge kept, n ticks of e electrons give floor(n e / Q) spikes."""
    steps = np.arange(200, dtype=np.uint8).reshape(5, 40)
    sensor = BoardSensor(place(), 0, "residual", 60)
    counts = sensor.expose(steps, 60).sum(axis=0)
    np.testing.assert_array_equal(counts, 60 * steps.astype(int) // 255)


def test_a_line_that_pauses_within_a_pulse_is_reported() -> None:
    """The pulse then lasts longer than a tick and starts surplus frames."""
    board = place()
    sensor = BoardSensor(board, 0, "residual", 10)
    port = board.board.bone.port
    assert isinstance(port, BridgePort)
    port.falter = 2000
    with pytest.raises(LineFault, match=r"started \d+ frames by 1 pulses: the line paused"):
        sensor.expose(np.zeros((5, 40), np.uint8), 3)


def test_wrong_bits_are_counted() -> None:
    """The electrons of a pixel change without the host's knowledge in 2 of its 6 ticks."""
    board = place()
    sensor = BoardSensor(board, 0, "residual", 10)
    steps = np.full((5, 40), 254, np.uint8)
    assert sensor.expose(steps, 2).sum() == 5 * 40
    board.board.bone.write(board.board.csr.base("pattern_mem"), 0xFEFEFE00)
    board.board.forget_counters()
    sensor.expose(steps, 2)
    assert sensor.wrong_bits == 2


@pytest.mark.parametrize("rate", [0.01, 0.06, 0.3, 0.5, 0.9, 1.0, 3.0])
def test_the_step_is_within_half_an_electron(rate: float) -> None:
    level = finest_level(rate)
    q = 255 + 256 * level
    wanted = np.linspace(0, rate, 1001)
    steps, error = quantise(wanted, level)
    np.testing.assert_allclose(steps / q - np.minimum(wanted, 1), error, atol=1e-15)
    assert np.abs(error).max() <= 0.5 / q + 1e-15
    # The next finer threshold would not hold the brightest.
    assert level == 15 or rate > 1 or rate * (q + 256) > 255


@pytest.mark.parametrize("byte_clocks", [1, None])
def test_planes_are_shown_and_come_back(byte_clocks: int | None) -> None:
    shown = np.random.default_rng(5).random((11, 5, 40)) < 0.3
    display = BoardDisplay(place(byte_clocks=byte_clocks), back=True)
    assert display.burst == 5  # of capture; the sink holds 6
    assert display.show(shown) == (11, False, 0)
    assert display.show(~shown[:4]) == (4, False, 0)  # the CRC goes on
    assert display.bytes == 15 * 5 * 2 * 4


def test_a_sink_that_shows_something_else_is_found() -> None:
    """A foreign word is pushed first, so every word is displayed one position late."""
    board = place()
    display = BoardDisplay(board)
    board.board.write("sink_data", 0)
    counted = display.show(np.ones((1, 5, 40), bool))
    assert counted.wrong_crc


def test_memories_too_small_for_a_frame_are_refused() -> None:
    with pytest.raises(InputError, match="holds a frame, 25 words, not one of 16 words"):
        BoardSensor(place(SMALL._replace(capture_words=16)), 0, "hard", 1)
    with pytest.raises(InputError, match="sink memory holds a plane, 10 words, not one of 8"):
        BoardDisplay(place(SMALL._replace(sink_words=8)))
    with pytest.raises(InputError, match="capture memory holds a plane, 25 words, not one of 16"):
        BoardDisplay(place(SMALL._replace(capture_words=16)), back=True)
    with pytest.raises(InputError, match="duration must be at most 1048576 cycles"):
        BoardSensor(place(), 0, "hard", (1 << 20) + 1)


def test_a_place_is_a_port_and_perhaps_a_baud() -> None:
    assert parse_address("serial:/dev/ttyUSB0", "k") == ("/dev/ttyUSB0", 115_200, (None, None))
    assert parse_address("serial:socket://10.0.0.7:1234,3000000", "k") == (
        "socket://10.0.0.7:1234",
        3_000_000,
        (None, None),
    )
    for words, given in (("", 115_200), (",9600", 9600)):
        address = f"serial:/dev/ttyUSB0{words},rts=off,dtr=on"
        assert parse_address(address, "k") == ("/dev/ttyUSB0", given, ("on", "off"))
    assert parse_address("udp:10.0.0.7", "k")[0] == "udp:10.0.0.7:1234"
    assert parse_address("udp:[::1]:1235", "k")[0] == "udp:[::1]:1235"
    for wrong in ("", "serial:", "usb:/dev/x", "serial:x,", "serial:x,0", "serial:x,fast",
                  "serial:x,dtr=low", "serial:x,9600,cts=on", "serial:x,dtr=on,dtr=on",
                  "serial:x,rts=on,9"):  # fmt: skip
        with pytest.raises(InputError, match="k must be serial:PORT"):
            parse_address(wrong, "k")


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("udp:", "a port over UDP must be udp:HOST or udp:HOST:PORT"),
        ("udp:10.0.0.7:0", "the port of udp:10.0.0.7 must be a number from 1 to 65535"),
        ("udp:10.0.0.7,115200", "k must be without a baud.*; write it like udp:10.0.0.7$"),
        ("serial:udp:10.0.0.7", "k must be udp:HOST.*; write it like udp:10.0.0.7$"),
    ],
)
def test_a_wrong_address_over_udp_says_how_to_write_it(address: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        parse_address(address, "k")


def test_a_board_over_udp_replaces_sensor_and_display(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bursts over Etherbone join, and the shown planes come back, on one board after another."""
    steps = np.random.default_rng(4).integers(0, 256, (5, 40)).astype(np.uint8)
    shown = np.random.default_rng(5).random((11, 5, 40)) < 0.3
    with EthernetBoard("udp:127.0.0.1:0", SMALL, level="model") as served:
        with open_board(served.port, "k") as opened:
            uploads = counted_uploads(monkeypatch)
            sensor = BoardSensor(opened, 1, "residual", 23)
            taken = sensor.expose(steps, 23)
            truth = planes(SMALL, Settings(threshold=1), steps, 23, np.zeros((5, 40), np.int64))
            np.testing.assert_array_equal(taken, truth)
            assert (sensor.wrong_bits, len(uploads), sensor.burst) == (0, 1, 5)
        with open_board(served.port, "k") as opened:
            assert BoardDisplay(opened, back=True).show(shown) == (11, False, 0)
    with (
        pytest.raises(InputError, match="must be the address of a board that answers"),
        open_board("udp:127.0.0.1:9", "k"),
    ):
        pass
