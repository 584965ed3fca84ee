"""A stream whose planes a stage makes when they are read, and a stage that reads a stream from its
first cycle on, block by block.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from cosim.clock import Clock
from cosim.spikes.viform import WORD, SpikeStream, Viform, Words, spikes_beyond, words_for
from cosim.stage import Block, blocks


class _Maker(Protocol):
    def step(self, data: Any, block: Block) -> Viform: ...


class StagedStream:
    """See `SpikeStream`; its words are read once, in ascending order, for some stages depend on
    what they have made before.

    Args:
        stage: makes the planes of consecutive blocks.
        shape: (H, W).
        cycles, clock: number and clock of the planes, which begin at the instant 0.
    """

    def __init__(
        self, stage: _Maker, shape: tuple[int, int], cycles: int, clock: Clock
    ) -> None:  # fmt: skip
        self._stage, self.shape, self.cycles, self.clock = stage, shape, cycles, clock
        self._made = 0

    def read_words(self, first: int, stop: int) -> Words:
        """Words `first` to `stop`, (n, H, W) uint32. Raises ValueError for words before the last
        ones that were read."""
        start, last = first * WORD, min(stop * WORD, self.cycles)
        if last <= start:
            return np.zeros((0, *self.shape), np.uint32)
        if start < self._made:
            raise ValueError(f"words must be read from cycle {self._made} on, not {start}")
        for block in blocks(start, start=self._made):
            self._stage.step(None, block)
        self._made = last
        return self._stage.step(None, Block(start, last - start)).words


class StreamStage:
    """Reads a stream; blocks begin at whole words. `step` is the only place that reads, so a stage
    that waits for a growing stream may stand in its place.

    Args:
        stream: read from its first word on.
        clock: clock of the cycles, which counts from 0; None for that of the stream.
    """

    def __init__(self, stream: SpikeStream, clock: Clock | None = None) -> None:
        self._stream, self._clock = stream, clock or stream.clock

    def step(self, data: Any, block: Block) -> Viform:
        """The planes of a block, which may end within a word; `data` is not used."""
        first = block.start // WORD
        words = self._stream.read_words(first, first + words_for(block.cycles))
        if spikes_beyond(words[-1], block.cycles):
            words = words.copy()
            words[-1] &= np.uint32((1 << block.cycles % WORD) - 1)
        return Viform(np.ascontiguousarray(words), block.cycles, self._clock, block.start)
