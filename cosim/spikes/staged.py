"""A stream whose planes a stage makes when they are read, and a stage that reads a stream from its
first cycle on, block by block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from cosim.clock import Clock
from cosim.spikes.ancillary import Ancillary, ChargePlane
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


class ToldStream:
    """A stream with ancillary data; see `SpikeStream`.

    Attributes:
        ancillary: what its source says beyond the spikes, see `Viform`.
    """

    def __init__(self, stream: SpikeStream, ancillary: Sequence[Ancillary]) -> None:
        self._stream, self.ancillary = stream, tuple(ancillary)
        self.shape, self.cycles, self.clock = stream.shape, stream.cycles, stream.clock
        self.start = int(getattr(stream, "start", 0))

    def read_words(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded), (n, H, W) uint32."""
        return self._stream.read_words(first, stop)


class Telling:
    """A stage that adds the ancillary data of a stream to its planes, whose cycles are counted from
    0. They are counted on the clock of the stream.

    Attributes:
        charges: whether planes of charges are among them.
    """

    def __init__(self, stream: SpikeStream | None) -> None:
        first, said = getattr(stream, "start", 0), getattr(stream, "ancillary", ())
        self._said = tuple(replace(each, cycle=each.cycle - first) for each in said)
        self.charges = any(isinstance(each, ChargePlane) for each in said)

    def __bool__(self) -> bool:
        return bool(self._said)

    def step(self, data: Viform, block: Block) -> Viform:
        """The planes of a block with what is said in it."""
        said = tuple(each for each in self._said if block.start <= each.cycle < block.stop)
        return replace(data, ancillary=said) if said else data


class StreamStage:
    """Reads a stream; blocks begin at whole words. `step` is the only place that reads, so a stage
    that waits for a growing stream may stand in its place.

    Args:
        stream: read from its first word on.
        clock: clock of the cycles, which counts from 0; None for that of the stream.

    Attributes:
        shape: (height, width) of the stream.
    """

    def __init__(self, stream: SpikeStream, clock: Clock | None = None) -> None:
        self._stream, self._clock = stream, clock or stream.clock
        self.shape = stream.shape
        self._telling = Telling(stream)

    def step(self, data: Any, block: Block) -> Viform:
        """The planes of a block, which may end within a word; `data` is not used."""
        first = block.start // WORD
        words = self._stream.read_words(first, first + words_for(block.cycles))
        if spikes_beyond(words[-1], block.cycles):
            words = words.copy()
            words[-1] &= np.uint32((1 << block.cycles % WORD) - 1)
        planes = Viform(np.ascontiguousarray(words), block.cycles, self._clock, block.start)
        return self._telling.step(planes, block)
