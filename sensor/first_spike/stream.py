"""Frames of a whole stream to its planes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim import Clock, SpikeStream, Viform
from cosim.viform import Words, words_for
from sensor.first_spike.coding import BAND, Code, decode_band, encode, frame_count, workers

__all__ = ["decode", "recode"]


def decode(
    code: Code, frames: Sequence[memoryview], shape: tuple[int, int], cycles: int, clock: Clock,
    start: int = 0,
) -> Viform:  # fmt: skip
    """The stream of all its frames, in the order of `encode`. Raises Damaged."""
    pixels, bands = shape[0] * shape[1], frame_count(shape, cycles)[1]
    words: Words = np.zeros((words_for(cycles), pixels), np.uint32)

    def draw(band: int) -> None:
        low, high = band * BAND, min((band + 1) * BAND, pixels)
        words[:, low:high] = decode_band(code, frames[band::bands], high - low, cycles)

    with workers() as pool:
        list(pool.map(draw, range(bands)))
    return Viform(words.reshape(-1, *shape), cycles, clock, start)


def recode(stream: SpikeStream, code: Code) -> Viform:
    """What is left of a stream that went through a code."""
    frames = [memoryview(frame.data) for frame in encode(stream, code, None)]
    start = int(getattr(stream, "start", 0))
    return decode(code, frames, stream.shape, stream.cycles, stream.clock, start)
