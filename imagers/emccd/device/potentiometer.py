"""The digital potentiometer that sets the high voltage, and the word that it gets over SPI.

Document 003: it has 256 steps and is configured over SPI. It names no chip. The word, the edges and
the wiper at power-on are those of a common one of 256 steps (MCP41xxx data sheet): 16 bits, the
most significant first, a command byte and a data byte. A bit is taken at the rising edge of the
clock, and the wiper moves when the chip select rises. A word of another length, or with another
command, moves nothing. Clock rate: assumed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from imagers.common.trace import Signal

_BITS: Final = 16
_WRITE: Final = 0x11
"""Command byte: C1 C0 = 01, write; P0 = 1, the only potentiometer."""
_CARES: Final = 0x31
"""Bits of the command byte that the chip looks at."""
_MIDDLE: Final = 0x80
_HALF: Final = 5
"""System clocks of half a period of SPI: 1 MHz at 10 MHz; assumed."""

SPI_SIGNALS: Final = (Signal("spi_select", before=1), Signal("spi_clock"), Signal("spi_data"))
"""Chip select (low while a word passes), clock (low at rest), data."""


def word_clocks() -> int:
    """System clocks from the fall of the select to its rise, when the wiper moves."""
    return (2 * _BITS + 1) * _HALF


def word_edges(edge: int, code: int) -> Iterator[tuple[int, str, int]]:
    """Yields (edge, signal, value) of the word that sets a code, from `edge` on, in order."""
    if not 0 <= code <= 0xFF:
        raise ValueError(f"code must be 0 to 255, not {code}")
    word = _WRITE << 8 | code
    yield edge, "spi_select", 0
    for n in range(_BITS):
        begin = edge + 2 * n * _HALF
        yield begin, "spi_data", word >> (_BITS - 1 - n) & 1
        yield begin + _HALF, "spi_clock", 1
        yield begin + 2 * _HALF, "spi_clock", 0
    yield edge + word_clocks(), "spi_select", 1


class Potentiometer:
    """The chip at the end of the wires, from power-on.

    Attributes:
        wiper: 0 to 255.
        words: words that have moved the wiper.
        refused: words that have not: of another length, or with another command.
    """

    def __init__(self) -> None:
        self.wiper, self.words, self.refused = _MIDDLE, 0, 0
        self._wires = {signal.name: signal.before for signal in SPI_SIGNALS}
        self._shifted = self._count = 0

    def change(self, signal: str, value: int) -> None:
        """Takes one change of a wire."""
        before, self._wires[signal] = self._wires[signal], value
        if signal == "spi_select" and before and not value:
            self._shifted = self._count = 0
        elif signal == "spi_clock" and value and not before and not self._wires["spi_select"]:
            self._shifted = (self._shifted << 1 | self._wires["spi_data"]) & 0xFFFF
            self._count += 1
        elif signal == "spi_select" and value and not before:
            self._load()

    def _load(self) -> None:
        whole = self._count > 0 and self._count % _BITS == 0
        if whole and self._shifted >> 8 & _CARES == _WRITE & _CARES:
            self.wiper, self.words = self._shifted & 0xFF, self.words + 1
        else:
            self.refused += 1
