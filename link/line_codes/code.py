"""The type of a line code: codewords of a group of symbols, coded for every cell independently.

Groups follow one another without gaps. The lowest bit of a codeword is sent first. The compiled
readers are imported on first use: the names of the codes are read at start-up, which must not wait
for numba.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Bits = npt.NDArray[np.bool_]
Read = Callable[[npt.NDArray[np.float32], npt.NDArray[np.uint8], npt.NDArray[np.float32]], None]
"""Fills values, (groups, cells) uint8, and margins, float32, from soft values, (groups * symbols,
cells) float32."""


@dataclass(frozen=True, eq=False)
class LineCode:
    """A line code.

    Attributes:
        name: name in scenarios and on the command line.
        symbols: symbols of a group.
        bits: bits that a cell carries in a group.
        run_limit: longest run of equal symbols; None if the data may make any.
        codewords: (states, 2^bits) uint16, bit k being symbol k; state 1 is positive running
            disparity.
        toggles: (2^bits,) bool, values that change the state; None for a code of one state.
        read: decoder; None for the one that compares all codewords of a code of one state.
    """

    name: str
    symbols: int
    bits: int
    run_limit: int | None
    codewords: npt.NDArray[np.uint16]
    toggles: Bits | None = None
    read: Read | None = None

    def encode(self, values: npt.NDArray[np.uint8], disparity: Bits | None = None) -> Bits:
        """Symbols of the cells, (groups * symbols, cells) bool.

        Args:
            values: (groups, cells), below 2^bits.
            disparity: (cells,) bool, whether the running disparity before the first group is
                positive; changed in place to that after the last group. None: negative everywhere,
                as before the first group of a transmission.
        """
        groups, cells = values.shape
        if values.size and int(values.max()) >> self.bits:
            raise ValueError(f"values of {self.name} must be below {1 << self.bits}")
        state = np.zeros(cells, np.bool_) if disparity is None else disparity
        out = np.empty((groups, self.symbols, cells), np.bool_)
        for group, value in enumerate(values):
            codes = self.codewords[0][value]
            if self.toggles is not None:
                codes = np.where(state, self.codewords[1][value], codes)
                state ^= self.toggles[value]
            for k in range(self.symbols):
                out[group, k] = codes & np.uint16(1 << k)
        return out.reshape(groups * self.symbols, cells)

    def decode(
        self, soft: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
        """The most likely values, (groups, cells) uint8, and the margins of the decisions, float32.

        A margin is the logarithm of the odds against the most likely other value, nats; 0 is a
        guess. Groups are read independently, with either running disparity.

        Args:
            soft: (groups * symbols, cells) float32, ln P(on) - ln P(off) of each symbol; NaN counts
                as 0.
        """
        if soft.ndim != 2 or len(soft) % self.symbols:
            raise ValueError(f"soft must be (groups * {self.symbols}, cells), not {soft.shape}")
        soft = np.ascontiguousarray(soft, np.float32)
        shape = len(soft) // self.symbols, soft.shape[1]
        values, margins = np.empty(shape, np.uint8), np.empty(shape, np.float32)
        if self.read is not None:
            self.read(soft, values, margins)
        else:
            from link.line_codes.reading import read_table

            read_table(soft, self.codewords[0], self.symbols, values, margins)
        return values, margins
