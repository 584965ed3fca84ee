"""Decoding of a whole stream."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim import Clock, SpikeStream, Viform
from cosim.compute.memory import check_memory
from cosim.compute.stopping import threads
from cosim.spikes.viform import Words, words_for
from sensor.codec.coding import BAND, Code, band_memory, decode_band, encode, frame_count, workers


def decode(
    code: Code, frames: Sequence[memoryview], shape: tuple[int, int], cycles: int, clock: Clock,
    start: int = 0, name: str = "the coded stream",
) -> Viform:  # fmt: skip
    """The stream of all its frames, in the order of `encode`. name: of what they are, for messages.

    Raises Damaged, and InputError where memory is short, before it is taken.
    """
    pixels, bands = shape[0] * shape[1], frame_count(shape, cycles)[1]
    ends = [(band * BAND, min((band + 1) * BAND, pixels)) for band in range(bands)]
    rooms = [band_memory(frames[b::bands], ends[b][1] - ends[b][0], cycles) for b in range(bands)]
    need = 4 * words_for(cycles) * pixels + sum(sorted(rooms)[-workers() :])
    check_memory(f"{name} in memory", need, "code it in shorter pieces")
    words: Words = np.zeros((words_for(cycles), pixels), np.uint32)

    def draw(band: int) -> None:
        low, high = ends[band]
        words[:, low:high] = decode_band(code, frames[band::bands], high - low, cycles)

    with threads(workers()) as pool:
        list(pool.map(draw, range(bands)))
    return Viform(words.reshape(-1, *shape), cycles, clock, start)


def recode(stream: SpikeStream, code: Code) -> Viform:
    """A stream coded and decoded again."""
    frames = [memoryview(frame.data) for frame in encode(stream, code, None)]
    start = int(getattr(stream, "start", 0))
    return decode(code, frames, stream.shape, stream.cycles, stream.clock, start)
