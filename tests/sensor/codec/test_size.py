"""Memory that the sizes of a stream take: in proportion to its bits, not to a byte for each."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.spikes.viform import unpack_planes, words_for
from sensor.codec.size import LAYOUTS, layout, sample_places


def stream(cycles: int) -> Viform:
    words = np.random.default_rng(1).integers(0, 1 << 32, (words_for(cycles), 16, 8), np.uint32)
    return Viform(words, cycles, Clock(40_000))


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_bits_are_laid_out_in_parts(name: str) -> None:
    made = stream(1 << 16)
    tracemalloc.start()
    try:
        data = layout(made, name)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(data) == made.words.nbytes == 1 << 20
    assert most < 3 * len(data)  # unpacked whole, planes would take eight times the bits


def test_planes_in_parts_are_planes() -> None:
    made = stream(3232)  # more than one part, and a rest
    planes = unpack_planes(made.words, 0, made.cycles).reshape(made.cycles, -1)
    assert layout(made, "plane") == np.packbits(planes, axis=1, bitorder="little").tobytes()


def test_the_sample_of_a_long_film_has_few_pixels() -> None:
    for seconds in (1, 4, 13):
        rows, columns = sample_places((1000, 1000), 40_000 * seconds)
        pixels = np.broadcast(rows, columns).size
        assert pixels * 40_000 * seconds <= 1 << 26 and pixels >= 128
