"""The board's counters of the serial line; a reset of the board does not clear them."""

from __future__ import annotations

import zlib


class LineCounters:
    """The registers `uart_*`, as attributes without that prefix. They are read modulo 2^32."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Sets all counters to their values after power-on."""
        self.rx_bytes = self.tx_bytes = 0
        self.framing_errors = self.watchdog_aborts = self.unknown_commands = 0
        self.writes = self.writes_crc = 0
        self.shortest_low = 0xFFFFFFFF

    def count_write(self, value: int) -> None:
        """Counts one word written over the line."""
        self.count_words(value.to_bytes(4, "big"))

    def count_words(self, data: bytes) -> None:
        """Counts words written over the line, big-endian."""
        self.writes += len(data) // 4
        self.writes_crc = zlib.crc32(data, self.writes_crc)

    def read(self, name: str) -> int:
        """The value of the register uart_`name`."""
        return int(getattr(self, name)) & 0xFFFFFFFF
