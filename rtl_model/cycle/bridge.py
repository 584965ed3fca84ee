"""A whole board at byte level over the cycle model: LiteX's uartbone with a simulated clock.

The behaviour is that of unmodified gateware (litex/soc/cores/uart.py, Stream2Wishbone): a watchdog
of 100 ms over the whole transaction, an unknown command that swallows length and address, length 0
for 256 words, writes that commit word by word, no FIFO before the bridge, so that bytes which come
while an answer goes out are lost.
"""

from __future__ import annotations

from typing import NamedTuple

from rtl_model.cycle.system import System
from rtl_model.geometry import Geometry

__all__ = ["Bridge", "Reply"]

_WRITES = {0x01: 4, 0x03: 0}  # command: step of the byte address
_READS = {0x02: 4, 0x04: 0}
_HEADER = 6


class Reply(NamedTuple):
    """Bytes that a board sends, and the clock at which each is handed to its transmitter."""

    data: bytes
    clocks: list[int]


class Bridge:
    """The board. Time is in its own clocks; bytes on either line take `byte_clocks` each.

    system: what stands behind it; None makes one of `geometry` that keeps no tiles.
    byte_clocks: None is ten bits at the geometry's baud; 1 is a line of no duration.
    """

    def __init__(
        self,
        geometry: Geometry | None = None,
        *,
        system: System | None = None,
        byte_clocks: int | None = None,
    ) -> None:
        self.system = System(geometry, keep=False) if system is None else system
        size = self.system.geometry
        self.byte_clocks = 10 * size.bit_clocks if byte_clocks is None else max(1, byte_clocks)
        self.watchdog_clocks = size.clock_hz // 10
        self._since = 0  # when the command byte of the transaction came
        self._got = b""  # bytes of the transaction; empty is idle
        self._free = 0  # until then an answer goes out
        self._last = -1  # when the last byte came

    @property
    def idle(self) -> bool:
        """Whether the next byte is taken as a command, as far as time has been told."""
        return not self._got

    def feed(self, data: bytes, clock: int) -> Reply:
        """Takes bytes whose first has come whole at `clock`, the others `byte_clocks` apart, and
        returns all that the board sends in answer. A clock that has passed already is now."""
        reply = Reply(bytearray(), [])  # type: ignore[arg-type]
        for byte in data:
            clock = max(clock, self._last + 1)
            self._last = clock
            self.wait(clock)
            self.system.line.rx_bytes += 1
            if clock >= self._free:
                self._take(byte, clock, reply)
            clock += self.byte_clocks
        return Reply(bytes(reply.data), reply.clocks)

    def wait(self, clock: int) -> None:
        """Lets time pass until `clock`; the watchdog may end the transaction."""
        if self._got and clock >= self._since + self.watchdog_clocks:
            self._abort()
        self.system.advance(clock)

    def framing_error(self, clock: int) -> None:
        """A byte came whose stop bit was low: counted and dropped."""
        self.wait(clock)
        self.system.line.framing_errors += 1

    def _abort(self) -> None:
        self._got = b""
        self.system.line.watchdog_aborts += 1

    def _take(self, byte: int, clock: int, reply: Reply) -> None:
        if not self._got:
            self._since = clock
        self._got += bytes([byte])
        command = self._got[0]
        count = len(self._got) - _HEADER
        if count == 0 and command in _READS:
            self._answer(clock + 1, reply)
        elif count == 0 and command not in _WRITES:
            self.system.line.unknown_commands += 1
            self._got = b""
        elif count > 0 and count % 4 == 0:
            word = count // 4 - 1
            self._write(self._address + word * _WRITES[command], self._got[-4:])
            if word + 1 == self._words:
                self._got = b""

    @property
    def _words(self) -> int:
        return self._got[1] or 256

    @property
    def _address(self) -> int:
        return int.from_bytes(self._got[2:_HEADER], "big") * 4

    def _write(self, address: int, data: bytes) -> None:
        value = int.from_bytes(data, "big")
        self.system.line.wrote(value)
        self.system.write(address & 0xFFFFFFFC, value)  # uart_clear takes its own count with it

    def _answer(self, clock: int, reply: Reply) -> None:
        """Reads and sends word by word, until all is sent or the watchdog ends it."""
        end = self._since + self.watchdog_clocks
        address, stride = self._address, _READS[self._got[0]]
        for _ in range(self._words):
            self.system.advance(clock)
            value = self.system.read(address & 0xFFFFFFFC)
            address += stride
            clock = max(clock, self.system.clock)
            for byte in value.to_bytes(4, "big"):
                if clock >= end:
                    self._free = clock
                    self._abort()
                    return
                reply.data.append(byte)  # type: ignore[attr-defined]
                reply.clocks.append(clock)
                self.system.line.tx_bytes += 1
                clock += self.byte_clocks
        self._free = clock
        self._got = b""
