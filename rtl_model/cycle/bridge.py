"""A whole board at byte level over the cycle model: LiteX's uartbone with a simulated clock.

The behaviour is that of unmodified gateware (litex/soc/cores/uart.py, Stream2Wishbone): a watchdog
of 100 ms over the whole transaction, an unknown command that swallows length and address, length 0
for 256 words, writes that commit word by word, no FIFO before the bridge, so that bytes which come
while an answer goes out are lost.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, Protocol

from rtl_model.cycle.line import LineCounters
from rtl_model.cycle.system import System
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS

__all__ = ["Behind", "Bridge", "Reply"]

_WRITES = {0x01: 4, 0x03: 0}  # command: step of the byte address
_READS = {0x02: 4, 0x04: 0}
_HEADER = 6
_ADDRESSES = 0xFFFFFFFC
_UART_CLEAR = next(entry.address for entry in REGISTERS if entry.name == "uart_clear")

# Clocks from a byte to the strobe on the bus that it leads to, and to the first byte of an answer,
# as the Verilog (viform_uartbone.v) has them.
_STROBE_OF_WRITE, _STROBE_OF_READ, _ANSWER = 1, 2, 5


class Behind(Protocol):
    """What may stand behind the bridge: registers on a bus, with a clock that time moves on.

    line: counters of the line. geometry: of which the bridge takes clock and baud. clock: edges
    passed since power-on.
    """

    @property
    def line(self) -> LineCounters: ...

    @property
    def geometry(self) -> Geometry: ...

    @property
    def clock(self) -> int: ...

    def advance(self, stop: int) -> None:
        """Runs up to clock `stop`; does nothing where that has passed."""

    def write(self, address: int, value: int) -> None:
        """Writes 32 bits at a byte address at this clock; takes one."""

    def read(self, address: int) -> int:
        """Returns the 32 bits at a byte address as they stand at this clock; takes two."""


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
        system: Behind | None = None,
        byte_clocks: int | None = None,
    ) -> None:
        self.system: Behind = System(geometry, keep=False) if system is None else system
        size = self.system.geometry
        self.byte_clocks = 10 * size.bit_clocks if byte_clocks is None else max(1, byte_clocks)
        self.watchdog_clocks = size.clock_hz // 10
        self._since = 0  # when the command byte of the transaction came
        self._got = bytearray()  # of the transaction; empty is idle
        self._free = 0  # until then an answer goes out
        self._coming: deque[int] = deque()  # when bytes come that are not counted yet
        self._last = -1  # when the last byte came
        self._cleared = -1  # edge of the last uart_clear: a byte that comes with it is not counted

    @property
    def idle(self) -> bool:
        """Whether the next byte is taken as a command, as far as time has been told."""
        return not self._got

    def feed(self, data: bytes, clock: int) -> Reply:
        """Takes bytes whose first has come whole at `clock`, the others `byte_clocks` apart, and
        returns all that the board sends in answer. A clock that has passed already is now."""
        sent: list[tuple[int, int]] = []
        arrivals = []
        for _ in data:
            clock = self._last = max(clock, self._last + 1)
            arrivals.append(clock)
            clock += self.byte_clocks
        self._coming.extend(arrivals)
        for byte, arrival in zip(data, arrivals, strict=True):
            self._watch(arrival)
            if arrival >= self._free:
                sent += self._take(byte, arrival)
        if arrivals:  # what stands behind has run up to the last strobe until now
            self.wait(arrivals[-1])
            self._count(arrivals[-1] + 1)
        return Reply(bytes(byte for _, byte in sent), [clock for clock, _ in sent])

    def wait(self, clock: int) -> None:
        """Lets time pass until `clock`; the watchdog may end the transaction."""
        self._watch(clock)
        self.system.advance(clock)

    def _watch(self, clock: int) -> None:
        """Ends the transaction where the watchdog does so before edge `clock` or at it."""
        end = self._since + self.watchdog_clocks
        if self._got and clock >= end:
            self._abort(end)

    def _count(self, clock: int) -> None:
        """Counts the bytes that have come before edge `clock`, some of them during an answer."""
        while self._coming and self._coming[0] < clock:
            self.system.line.rx_bytes += self._coming.popleft() != self._cleared

    def framing_error(self, clock: int) -> None:
        """A byte came whose stop bit was low: counted and dropped."""
        self.wait(clock)
        self.system.line.framing_errors += 1

    def _abort(self, clock: int) -> None:
        """The watchdog ends the transaction at an edge; a byte that comes with it is lost too."""
        self._got = bytearray()
        self._free = clock + 1
        self.system.line.watchdog_aborts += 1

    def _take(self, byte: int, clock: int) -> list[tuple[int, int]]:
        """Takes one byte and returns (clock, byte) of what it makes the board send."""
        if not self._got:
            self._since = clock
        self._got.append(byte)
        command = self._got[0]
        count = len(self._got) - _HEADER
        if count == 0 and command in _READS:
            return self._answer(clock)
        if count == 0 and command not in _WRITES:
            self.system.line.unknown_commands += 1
            self._got = bytearray()
        elif count > 0 and count % 4 == 0:
            word = count // 4 - 1
            self._count(clock + 1)
            self._write(clock, self._address + word * _WRITES[command], bytes(self._got[-4:]))
            if word + 1 == self._words:
                self._got = bytearray()
        return []

    @property
    def _words(self) -> int:
        return self._got[1] or 256

    @property
    def _address(self) -> int:
        return int.from_bytes(self._got[2:_HEADER], "big") * 4

    def _write(self, clock: int, address: int, data: bytes) -> None:
        value = int.from_bytes(data, "big")
        self.system.advance(clock + _STROBE_OF_WRITE)
        self.system.line.wrote(value)
        self.system.write(address & _ADDRESSES, value)  # uart_clear takes its own count with it
        if address & _ADDRESSES == _UART_CLEAR and value & 1:
            self._cleared = self.system.clock - 1

    def _answer(self, clock: int) -> list[tuple[int, int]]:
        """Reads and sends word by word, until all is sent or the watchdog ends it. `clock` is when
        the request's last byte came, then when the answer's last byte was accepted."""
        end = self._since + self.watchdog_clocks
        address, stride = self._address, _READS[self._got[0]]
        sent: list[tuple[int, int]] = []
        ready = clock  # when the transmitter takes a byte
        for _ in range(self._words):
            if clock + _STROBE_OF_READ > end:
                self._abort(end)
                return sent
            self.system.advance(clock + _STROBE_OF_READ)
            self._count(clock + _STROBE_OF_READ)
            value = self.system.read(address & _ADDRESSES)
            address += stride
            ready = max(ready, clock + _ANSWER)
            for byte in value.to_bytes(4, "big"):
                if ready > end:
                    self._abort(end)
                    return sent
                clock = ready
                sent.append((clock, byte))
                self.system.line.tx_bytes += 1
                ready += self.byte_clocks
        if clock == end:  # cut when nothing was left to cut
            self._abort(end)
        self._got = bytearray()
        self._free = clock + 1
        return sent
