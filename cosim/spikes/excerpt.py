"""A stream as a stage: its planes from the first cycle on, block by block."""

from __future__ import annotations

from typing import Any

import numpy as np

from cosim.clock import Clock
from cosim.spikes.viform import WORD, SpikeStream, Viform, spikes_beyond, words_for
from cosim.stage import Block


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
