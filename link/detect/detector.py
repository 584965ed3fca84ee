"""The interface of a detector, and the types that all detectors share."""

from __future__ import annotations

from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Words

LIMIT: Final = 60.0
"""Largest magnitude of a soft value."""
Bits = npt.NDArray[np.bool_]
"""(symbols, cells) bits of data cells."""
Soft = npt.NDArray[np.float32]
"""(symbols, cells) log likelihood ratios: ln P(spikes | on) - ln P(spikes | off)."""


def bits_held(words: Words, start_tick: int, stop_tick: int | None) -> int:
    """Number of ticks in `words`, from start_tick on, that belong to the stream."""
    every = len(words) * WORD
    return every if stop_tick is None else min(max(stop_tick - start_tick, 0), every)


class Detector(Protocol):
    """Computes soft values of the data cells from the spikes of the camera's pixels.

    Symbols are counted from first light, the timing's `first`. `words` is (n, H, W) uint32; bit 0
    of word 0 is tick start_tick.
    """

    def learn(self, words: Words, start_tick: int, known: Bits, first_symbol: int) -> None:
        """Learns from known symbols; every call adds to the statistics of earlier calls."""
        ...

    def learn_pilots(self, words: Words, start_tick: int, first_symbol: int, count: int) -> None:
        """Learns from the pilot cells alone, for a stream that begins after the training."""
        ...

    def soft(
        self, words: Words, start_tick: int, first_symbol: int, count: int,
        stop_tick: int | None = None,
    ) -> Soft:  # fmt: skip
        """Soft values of `count` symbols; 0 for a symbol that is not in the words.

        Args:
            words: spikes, from tick start_tick on.
            start_tick: tick of bit 0 of word 0.
            first_symbol, count: symbols to decide.
            stop_tick: end of the stream if it lies within the last word; later bits are not read.
        """
        ...
