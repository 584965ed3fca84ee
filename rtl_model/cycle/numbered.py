"""Numbered writes, each of which is performed once (the memory `write_mem`).

A line without acknowledgement may lose, repeat or reorder writes. A numbered write consists of
number, byte address, count and words. The board performs it only if its number is the next one,
and then expects the following number. So a repeated or a late one has no effect, and the host
repeats a write until its number has been passed.
"""

from __future__ import annotations

from rtl_model.registers import WRITE_WORDS

_NUMBER, _ADDRESS, _COUNT = 0, 1, 2  # words of the memory; the data follow
_WORD = 0xFFFFFFFF


class NumberedWrites:
    """State of the memory; only a power cycle clears it.

    Attributes:
        number: the next number, modulo 2^32.
        arrived: numbered writes that arrived, with whatever number, modulo 2^32.
    """

    def __init__(self) -> None:
        self.number = self.arrived = 0
        self._open = self._fixed = False
        self._address = self._left = 0

    def write(self, index: int, value: int) -> int | None:
        """Writes word `index`; returns the byte address that the value is passed on to, if any."""
        if index == _NUMBER:
            self._open = value == self.number
            self.arrived = self.arrived + 1 & _WORD
        elif index == _ADDRESS:
            self._address, self._fixed = value & ~3, bool(value & 1)
        elif index == _COUNT:
            self._left = value % WRITE_WORDS
        elif self._open and self._left:
            address = self._address
            self._address = address + (0 if self._fixed else 4) & _WORD
            self._left -= 1
            if not self._left:
                self._open = False
                self.number = self.number + 1 & _WORD
            return address
        return None

    def whole(self, data: bytes) -> tuple[int, bytes] | None:
        """Byte address and words (big-endian) of a complete numbered write that is the next one.

        None for others, and for words that all go to one address.
        """
        number, address, count = (int.from_bytes(data[at : at + 4], "big") for at in (0, 4, 8))
        if number != self.number or address & 3 or not 0 < 4 * count == len(data) - 12:
            return None
        return address, data[12:]

    def perform(self) -> None:
        """Counts a write that `whole` has returned and that was performed."""
        self._open = False
        self.arrived = self.arrived + 1 & _WORD
        self.number = self.number + 1 & _WORD

    def read(self, index: int) -> int:
        """Reads word `index`."""
        return (self.number, self.arrived)[index] if index < _COUNT else 0
