"""A minimal host for tests of the board: pyserial without retries."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import serial

from rtl_model.geometry import Geometry
from rtl_model.registers import MAGIC, REGISTERS
from rtl_model.virtual import Level, VirtualBoard

needs_verilator = pytest.mark.skipif(
    shutil.which("verilator") is None, reason="needs the system package verilator"
)
LEVELS = ["model", pytest.param("bytes", marks=needs_verilator)]
# Each fault of the design is a build of its own.
PLANTED = ["model", pytest.param("bytes", marks=[needs_verilator, pytest.mark.slow])]
SMALL = Geometry(rows=8, columns=40, lanes=32, clock_hz=1_000_000, baud=62_500, capture_words=256)
"""Sixteen clocks a bit, and the shortest tick."""

ADDRESS = {register.name: register.address for register in REGISTERS}
MAGIC_BYTES = MAGIC.to_bytes(4, "big")


PATIENCE_S = 20.0
"""Wait for an answer, s, which allows for a busy machine and a first compilation."""


class Host:
    """One connection. `patience` is the wait for an answer that may be incomplete, s."""

    def __init__(self, port: str, baud: int, patience: float) -> None:
        self._serial = serial.Serial(port, baud, write_timeout=PATIENCE_S)
        self._patience = patience

    def send(self, *data: int) -> None:
        self._serial.write(bytes(data))

    def close(self) -> None:
        self._serial.close()

    def speak_at(self, baud: int) -> None:
        self._serial.baudrate = baud

    def forget(self) -> None:
        """Discards unread bytes."""
        self._serial.reset_input_buffer()

    def answer(self, count: int, short: bool = False) -> bytes:
        """short: fewer bytes may be all there are."""
        self._serial.timeout = self._patience if short else PATIENCE_S
        return bytes(self._serial.read(count))

    def ask(self, name: str, words: int = 1, command: int = 2, short: bool = False) -> bytes:
        self.send(command, words & 255, *(ADDRESS[name] // 4).to_bytes(4, "big"))
        return self.answer(4 * (words or 256), short)

    def read(self, name: str) -> int:
        data = self.ask(name)
        assert len(data) == 4, f"{name}: {data.hex()}"
        return int.from_bytes(data, "big")

    def write(self, name: str, value: int) -> None:
        address = (ADDRESS[name] // 4).to_bytes(4, "big")
        self.send(1, 1, *address, *value.to_bytes(4, "big"))

    def until(self, name: str, mask: int, seconds: float = 20.0) -> int:
        """Reads until one of the bits is set."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            value = self.read(name)
            if value & mask:
                return value
        raise AssertionError(f"{name} stays {value:#x}")

    def until_scanned(self, seconds: float = 20.0) -> int:
        """Waits for the last frame of a stopped sensor without a window; returns its frames."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            frames = self.read("sensor_frames")
            if self.read("sensor_rows_read") == frames * SMALL.rows:
                return frames
        raise AssertionError("a begun frame does not end")


def pass_time(made: VirtualBoard, seconds: float, since: int | None = None) -> None:
    """Waits for a duration in the board's time, which lags behind the wall clock on a busy machine.

    There must be no loss of power meanwhile. A wait that begins long after the last byte is slow,
    because the board rests then.

    since: clock of the board at which the duration begins; now if None.
    """
    begun = made.clock if since is None else since
    until = begun + round(seconds * made.geometry.clock_hz)
    end = time.monotonic() + PATIENCE_S
    while made.clock < until:
        assert time.monotonic() < end, "the board's clock stands"
        time.sleep(0.005)


@contextmanager
def board(
    level: Level, *faults: str, geometry: Geometry = SMALL, baud: int | None = None
) -> Iterator[tuple[VirtualBoard, Host]]:
    """A board and a connected host."""
    with VirtualBoard(geometry, level=level, faults=faults) as made:
        host = Host(made.port, baud or geometry.baud, 0.3 * made.time_scale)
        try:
            yield made, host
        finally:
            host.close()
