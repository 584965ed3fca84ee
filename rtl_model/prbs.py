"""Pseudo-random bit sequences from a shift register (ITU-T O.150's orders 7, 15, 23, 31).

The new bit is the exclusive or of two taps, shifted in at bit 0 and sent; the register starts with
all ones. Taps, counted from zero, are those LiteX uses (litex/soc/cores/prbs.py).
"""

from __future__ import annotations

__all__ = ["ORDERS", "TAPS", "Prbs"]

TAPS: dict[int, tuple[int, int]] = {7: (5, 6), 15: (13, 14), 23: (17, 22), 31: (27, 30)}
"""Order to its two taps; any other order runs as 31."""
ORDERS = tuple(TAPS)


class Prbs:
    """One shift register of an order, which gives 32 bits at a time."""

    def __init__(self, order: int = 31) -> None:
        self.order = order if order in TAPS else 31
        self._state = (1 << self.order) - 1

    def bits(self, count: int) -> list[int]:
        """Returns the next bits, in the order in which they are sent."""
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
        """Returns the next 32 bits, the first in bit 31."""
        made = 0
        for bit in self.bits(32):
            made = made << 1 | bit
        return made
