"""Pseudo-random bit sequences from a shift register (orders 7, 15, 23 and 31 of ITU-T O.150).

The new bit is the exclusive or of two taps. It is shifted in at bit 0 and sent. The register starts
with all ones. The taps, counted from 0, are those of LiteX (litex/soc/cores/prbs.py).
"""

from __future__ import annotations

TAPS: dict[int, tuple[int, int]] = {7: (5, 6), 15: (13, 14), 23: (17, 22), 31: (27, 30)}
"""The two taps of each order. Any other order behaves as 31."""
ORDERS = tuple(TAPS)


class Prbs:
    """A shift register.

    Attributes:
        order: number of its bits, a key of `TAPS`.
    """

    def __init__(self, order: int = 31) -> None:
        self.order = order if order in TAPS else 31
        self._state = (1 << self.order) - 1

    def bits(self, count: int) -> list[int]:
        """The next `count` bits, in order of transmission."""
        first, second = TAPS[self.order]
        mask = (1 << self.order) - 1
        state, sent = self._state, []
        for _ in range(count):
            bit = (state >> first ^ state >> second) & 1
            state = (state << 1 | bit) & mask
            sent.append(bit)
        self._state = state
        return sent

    def word(self) -> int:
        """The next 32 bits, the first in bit 31."""
        word = 0
        for bit in self.bits(32):
            word = word << 1 | bit
        return word
