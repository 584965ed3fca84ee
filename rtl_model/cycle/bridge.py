"""A complete board at byte level: LiteX's uartbone in front of the cycle model.

The behaviour is that of the unmodified gateware (litex/soc/cores/uart.py, Stream2Wishbone). A
watchdog ends a transaction after 100 ms. An unknown command consumes length and address. Length 0
means 256 words. Writes take effect word by word. The bridge has no input FIFO, so bytes that arrive
during an answer are lost.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, Protocol

from rtl_model.cycle.system import LineCounters, System
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS

_WRITES = {0x01: 4, 0x03: 0}  # command: step of the byte address
_READS = {0x02: 4, 0x04: 0}
_HEADER = 6
_ADDRESSES = 0xFFFFFFFC
_UART_CLEAR = next(entry.address for entry in REGISTERS if entry.name == "uart_clear")

# Clocks from a byte to the resulting strobe on the bus, and to the first byte of an answer, as in
# the Verilog (viform_uartbone.v).
_STROBE_OF_WRITE, _STROBE_OF_READ, _ANSWER = 1, 2, 5


class Behind(Protocol):
    """A device behind the bridge: registers on a bus, and a simulated clock.

    Attributes:
        line: counters of the line.
        geometry: geometry of the build; the bridge uses its clock and baud.
        clock: edges passed since power-on.
    """

    @property
    def line(self) -> LineCounters: ...

    @property
    def geometry(self) -> Geometry: ...

    @property
    def clock(self) -> int: ...

    def advance(self, stop: int) -> None:
        """Runs up to clock `stop`; does nothing if it has passed."""

    def write(self, address: int, value: int) -> None:
        """Writes 32 bits at a byte address; takes one clock."""

    def read(self, address: int) -> int:
        """Reads 32 bits at a byte address; takes two clocks."""


class Reply(NamedTuple):
    """Bytes from the board.

    Attributes:
        data: the bytes.
        clocks: clock at which the transmitter accepts each byte.
    """

    data: bytes
    clocks: list[int]


class Bridge:
    """A board at byte level. Time is counted in its clocks.

    Args:
        geometry: geometry of the build, if `system` is None.
        system: device behind the bridge; a cycle model that stores no tiles if None.
        byte_clocks: clocks of a byte on the line in either direction; ten bits at the geometry's
            baud if None, 1 for a line without duration.

    Attributes:
        system, byte_clocks: device behind the bridge, and clocks of a byte, as above.
        watchdog_clocks: longest transaction, clocks.
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
        self._since = 0  # arrival of the transaction's command byte
        self._got = bytearray()  # bytes of the transaction; empty when idle
        self._free = 0  # clock until which an answer is sent
        self._coming: deque[int] = deque()  # arrivals of bytes that are not counted yet
        self._last = -1  # arrival of the last byte
        self._cleared = -1  # edge of the last uart_clear; a byte at this edge is not counted

    @property
    def idle(self) -> bool:
        """Whether the next byte will be taken as a command."""
        return not self._got

    def feed(self, data: bytes, clock: int) -> Reply:
        """Feeds bytes to the board; returns all bytes that it sends in answer.

        Args:
            data: bytes, which arrive `byte_clocks` apart.
            clock: arrival of the first byte; the present clock if it has passed.
        """
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
        if arrivals:  # until now the system has run up to the last strobe only
            self.wait(arrivals[-1])
            self._count(arrivals[-1] + 1)
        return Reply(bytes(byte for _, byte in sent), [clock for clock, _ in sent])

    def wait(self, clock: int) -> None:
        """Runs up to `clock`. The watchdog may end the transaction."""
        self._watch(clock)
        self.system.advance(clock)

    def _watch(self, clock: int) -> None:
        """Ends the transaction if the watchdog expires at or before edge `clock`."""
        end = self._since + self.watchdog_clocks
        if self._got and clock >= end:
            self._abort(end)

    def _count(self, clock: int) -> None:
        """Counts the bytes that arrived before edge `clock`, including those during an answer."""
        while self._coming and self._coming[0] < clock:
            self.system.line.rx_bytes += self._coming.popleft() != self._cleared

    def _abort(self, clock: int) -> None:
        """Ends the transaction at an edge by the watchdog. A byte at this edge is lost too."""
        self._got = bytearray()
        self._free = clock + 1
        self.system.line.watchdog_aborts += 1

    def _take(self, byte: int, clock: int) -> list[tuple[int, int]]:
        """Takes one byte; returns (clock, byte) of the answer that it causes."""
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
        self.system.line.count_write(value)
        self.system.write(address & _ADDRESSES, value)  # uart_clear also clears its own count
        if address & _ADDRESSES == _UART_CLEAR and value & 1:
            self._cleared = self.system.clock - 1

    def _answer(self, clock: int) -> list[tuple[int, int]]:
        """Reads and sends word by word, until all are sent or the watchdog expires.

        Args:
            clock: arrival of the request's last byte.
        """
        end = self._since + self.watchdog_clocks
        address, stride = self._address, _READS[self._got[0]]
        sent: list[tuple[int, int]] = []
        ready = clock  # next clock at which the transmitter accepts a byte
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
        if clock == end:  # the watchdog expires with the last byte
            self._abort(end)
        self._got = bytearray()
        self._free = clock + 1
        return sent
