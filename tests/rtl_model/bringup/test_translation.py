"""Bytes that something on the way translates, and faults of which no byte is missing."""

from __future__ import annotations

import pytest

from tests.rtl_model.bringup.faulty_ports import SIZE, EveryByte
from tests.rtl_model.bringup.model_port import ModelPort
from tests.rtl_model.bringup.test_stages import brought_up


def doubled(data):
    return [each for byte in data for each in ([byte, byte] if byte == 0xFF else [byte])]


def line_ends(data):
    return [each for byte in data for each in ([0x0D, 0x0A] if byte == 0x0A else [byte])]


TRANSLATIONS = {
    "7 data bits": lambda data: [byte & 0x7F for byte in data],
    "software flow control": lambda data: [byte for byte in data if byte not in (0x11, 0x13)],
    "0xff is doubled": doubled,
    "0x0a becomes 0x0d 0x0a": line_ends,
    "0x0d becomes 0x0a": lambda data: [0x0A if byte == 0x0D else byte for byte in data],
}
KNOWN_DIRECTION = {"software flow control", "0xff is doubled", "0x0a becomes 0x0d 0x0a"}
WAYS = {"to": "to the board", "from": "from the board", "both": "in both directions"}


class Translating(ModelPort):
    """Changes the bytes of one direction or of both."""

    def __init__(self, change, way):
        self.change, self.way = change, way
        super().__init__(SIZE)

    def to_board(self, data):
        return super().to_board(bytes(self.change(data)) if self.way != "from" else data)

    def to_host(self, data):
        heard = super().to_host(data)
        return bytes(self.change(heard)) if self.way != "to" else heard


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", TRANSLATIONS)
def test_a_translation_is_named(name, way):
    report = brought_up(Translating(TRANSLATIONS[name], way))
    assert report.failed.kind == "translated" and name in report.cause
    direction = WAYS[way] if name in KNOWN_DIRECTION else "on the way to or from the board"
    if name == "software flow control" and way == "both":
        direction = WAYS["to"]  # the byte never returns
    assert direction in report.cause


class Pause(ModelPort):
    """The byte `at` arrives late, and every other one in time."""

    def __init__(self, at):
        self.at, self.count = at, 0
        super().__init__(SIZE)

    def write(self, data, deadline_s=1.0):
        for n in range(len(data)):
            self.count += 1
            if self.count == self.at:
                self._clock += int(0.15 * self.geometry.clock_hz)
            super().write(data[n : n + 1], deadline_s)


@pytest.mark.parametrize("at", [500, 2001])
def test_a_pause_within_a_request_is_no_lost_byte(at):
    cause = brought_up(Pause(at)).cause
    assert "cut by its watchdog, though every byte arrived: a pause of more than 100 ms" in cause
    assert "bytes to the board were lost:" not in cause


def test_an_added_byte_is_not_also_lost():
    port = EveryByte("extra", "rx", 1)
    port.hits = lambda: port.count == 1500
    cause = brought_up(port).cause
    assert "1 byte to the board added" in cause and "were lost:" not in cause


class Restarts(ModelPort):
    """Loses its power before the byte `at`."""

    def __init__(self, at):
        self.at, self.count = at, 0
        super().__init__(SIZE)

    def write(self, data, deadline_s=1.0):
        before, self.count = self.count, self.count + len(data)
        if before < self.at <= self.count:
            self._power_on()
        super().write(data, deadline_s)


@pytest.mark.parametrize("at", [40, 60, 70, 100])
def test_a_restart_before_the_first_counts_is_a_restart(at):
    report = brought_up(Restarts(at))
    assert (report.failed_stage, report.failed.kind) == ("identity", "restarted")


class Dies(ModelPort):
    """Sends nothing after 3000 bytes."""

    count = 0

    def write(self, data, deadline_s=1.0):
        self.count += len(data)
        super().write(data, deadline_s)

    def answer(self, data, clocks):
        if self.count < 3000:
            super().answer(data, clocks)


def test_a_board_that_falls_silent_has_its_wires_right():
    report = brought_up(Dies(SIZE))
    assert report.failed.kind == "silent" and report.failed_stage == "registers"
    assert "though the board answered before; check its supply and its reset" in report.cause
    assert "crossed" not in report.cause
