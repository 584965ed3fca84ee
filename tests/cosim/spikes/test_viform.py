"""The word layout bit by bit, and counts of spikes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Clock, Viform
from cosim.spikes.viform import count_spikes, pack_planes, spikes_beyond, unpack_planes, words_for

CLOCK = Clock(40_000)


@st.composite
def random_planes(draw: st.DrawFn) -> np.ndarray:
    """(T, H, W) bool, T from 1 to 130."""
    shape = (draw(st.integers(1, 130)), draw(st.integers(1, 4)), draw(st.integers(1, 5)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return rng.random(shape) < draw(st.sampled_from([0.0, 0.1, 0.5, 1.0]))


def test_bit_b_of_word_w_is_cycle_32_w_plus_b() -> None:
    for t in range(70):
        planes = np.zeros((70, 2, 3), np.uint8)
        planes[t, 1, 2] = 1
        expected = np.zeros((3, 2, 3), np.uint32)
        expected[t // 32, 1, 2] = 2 ** (t % 32)
        words = pack_planes(planes)
        assert words.dtype == np.uint32
        np.testing.assert_array_equal(words, expected)


@pytest.mark.parametrize(("cycles", "words"), [(0, 0), (1, 1), (32, 1), (33, 2), (64, 2), (65, 3)])
def test_words_for_rounds_up(cycles: int, words: int) -> None:
    assert words_for(cycles) == words
    assert len(pack_planes(np.ones((cycles, 1, 1), bool))) == words


@given(random_planes())
def test_what_is_packed_is_unpacked(planes: np.ndarray) -> None:
    stream = Viform.from_planes(planes, CLOCK)
    assert stream.cycles == len(planes)
    assert stream.shape == planes.shape[1:]
    np.testing.assert_array_equal(stream.planes(), planes)
    np.testing.assert_array_equal(pack_planes(planes.astype(np.uint8)), stream.words)
    assert not spikes_beyond(stream.words[-1], stream.cycles)


@given(random_planes(), st.data())
def test_any_window_is_unpacked_and_counted_alone(planes: np.ndarray, data: st.DataObject) -> None:
    first = data.draw(st.integers(0, len(planes)))
    stop = data.draw(st.integers(first, len(planes)))
    stream = Viform.from_planes(planes, CLOCK)
    window = unpack_planes(stream.words, first, stop)
    np.testing.assert_array_equal(window, planes[first:stop])
    count = count_spikes(stream, first, stop)
    assert count.dtype == np.uint32
    np.testing.assert_array_equal(count, planes[first:stop].sum(axis=0))


def test_streams_are_equal_by_content() -> None:
    planes = np.random.default_rng(1).random((40, 2, 2)) < 0.5
    one = Viform.from_planes(planes, CLOCK)
    assert one == Viform.from_planes(planes, Clock(40_000))
    assert one != Viform.from_planes(~planes, CLOCK)
    assert one != Viform.from_planes(planes, Clock(20_000))
    assert one != Viform(one.words, 40, CLOCK, 64)
    assert one != Viform(np.concatenate([one.words, one.words[:1] * 0]), 65, CLOCK)
    assert one != "a stream"


@pytest.mark.parametrize(
    ("words", "cycles", "text"),
    [
        (np.zeros((1, 2), np.uint32), 5, r"words must be \(n, H, W\) uint32, not \(1, 2\) uint32"),
        (np.zeros((1, 2, 2), np.int32), 5, r"not \(1, 2, 2\) int32"),
        (np.zeros((1, 2, 2), np.uint32), 33, "33 cycles must lie in 2 words, not 1"),
        (np.zeros((2, 2, 2), np.uint32), 32, "32 cycles must lie in 1 words, not 2"),
        (np.zeros((0, 2, 2), np.uint32), 0, "0 cycles must lie in 0 words"),
        (np.zeros((0, 2, 2), np.uint32), -1, "-1 cycles must lie in 0 words"),
        (np.full((1, 1, 1), 0x20, np.uint32), 5, "spikes must lie within 5 cycles, not beyond"),
    ],
)
def test_words_that_are_no_stream_are_refused(words: np.ndarray, cycles: int, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        Viform(words, cycles, CLOCK)
