"""When the spikes of a block come: halves of a packet's cycles."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.spikes.viform import unpack_planes
from sensor.codec.packets.counts import pyramid
from sensor.codec.packets.layered import Layered
from sensor.codec.packets.midpoints import SCALE, WINDOW
from sensor.codec.packets.ranges import FRESH, encode_bits, from_bytes, open_bits, to_bytes
from sensor.codec.packets.spans import SPAN_CONTEXTS, SPAN_LEVEL, get_spans, put_spans, spans_of
from tests.sensor.codec.packets.streams import random_stream, steady


def through(words, cycles):
    """(spikes of blocks and words as decoded, bytes, gain)."""
    height, width = words.shape[1:]
    sums = pyramid(np.bitwise_count(words).sum(axis=0).astype(np.int32))[SPAN_LEVEL]
    decisions, out = np.empty(10**6, np.uint16), np.empty(10**6, np.uint32)
    count, gain = put_spans(spans_of(words), sums, height, width, cycles, decisions, 0)
    model = np.full(SPAN_CONTEXTS, FRESH, np.uint32)
    data = to_bytes(out[: encode_bits(decisions, count, model, out)])
    model[:], coded, spans = FRESH, from_bytes(data), np.zeros_like(spans_of(words))
    reader = np.array(open_bits(coded), np.uint64)
    assert get_spans(coded, model, reader, sums, cycles, spans)
    return spans, len(data), gain / SCALE


def moving_edge(cycles, side=32, speed=0.1):
    """Words of an edge between .05 and .6 spikes a cycle that moves `speed` pixels a cycle."""
    t, x = np.arange(cycles)[:, None, None], np.arange(side)[None, None, :]
    light = np.where(x < 8 + speed * t, 0.6, 0.05) + np.zeros((cycles, side, side))
    phase = np.random.default_rng(1).random((side, side))
    charge = np.floor(np.cumsum(light, axis=0) + phase)
    planes = np.diff(charge, axis=0, prepend=np.floor(phase)[None]) > 0
    words = np.zeros((-(-cycles // 32), side, side), np.uint32)
    for n, plane in enumerate(planes):
        words[n // 32] |= plane.astype(np.uint32) << np.uint32(n % 32)
    return words


def test_spikes_of_a_block_are_those_of_its_pixels():
    words = (np.random.default_rng(3).random((3, 10, 13)) * 2**32).astype(np.uint32)
    expected = np.zeros((3, 3, 4), int)
    for y, x in np.ndindex(10, 13):
        expected[:, y // 4, x // 4] += np.bitwise_count(words[:, y, x])
    assert np.array_equal(spans_of(words), expected)


def test_steady_light_is_not_split_and_takes_next_to_nothing():
    rng = np.random.default_rng(2)
    words = steady(np.full((64, 64), 0.31), rng.random((64, 64)), 512, 0.1)
    spans, size, gain = through(words, 512)
    assert gain == 0
    assert size < 12
    total = np.bitwise_count(words).sum(axis=0).reshape(16, 4, 16, 4).sum(axis=(1, 3))
    assert np.abs(spans - total / 16).max() <= 1


@pytest.mark.parametrize("cycles", [33, 64, 96, 128, 416, 500, 512])
def test_a_block_that_changes_is_known_to_a_word(cycles):
    """Pixels of 4 x 4 that fire in every cycle from one on, which lies on the border of a word."""
    words = np.zeros((-(-cycles // 32), 16, 24), np.uint32)
    first = np.random.default_rng(cycles).integers(0, len(words) + 1, (4, 6))
    for y, x in np.ndindex(16, 24):
        words[first[y // 4, x // 4] :, y, x] = 0xFFFFFFFF
    if cycles % 32:
        words[-1] &= np.uint32((1 << cycles % 32) - 1)
    spans, _, _ = through(words, cycles)
    split = np.abs(spans - spans_of(words)).reshape(len(words), 2, 2, 3, 2).max(axis=(0, 2, 4))
    assert (split == 0).mean() > 0.6  # a block whose last words alone differ may not be worth it
    assert np.array_equal(spans.sum(axis=0), spans_of(words).sum(axis=0))


def test_what_is_decoded_adds_up_in_any_stream():
    for seed in range(200):
        words, cycles = random_stream(seed)
        spans, _, _ = through(words, cycles)
        assert (spans >= 0).all(), seed
        assert np.array_equal(spans.sum(axis=0), spans_of(words).sum(axis=0)), seed


def windows(planes):
    """Counts in windows of 41 cycles, at each place."""
    upto = np.cumsum(planes, axis=0, dtype=np.float64)
    return upto[WINDOW:] - upto[:-WINDOW]


def test_a_moving_edge_is_where_it_is():
    """Layers 0 and 1 have a quarter or less of the error of the same sums without time."""
    words = moving_edge(128)
    data = [layer.data for layer in Layered().encode(words, 128)]
    truth = windows(unpack_planes(words, 0, 128))
    left = windows(unpack_planes(Layered().decode(data[:2], (32, 32), 128), 0, 128))
    sums = np.bitwise_count(words).sum(axis=0).reshape(16, 2, 16, 2).sum(axis=(1, 3))
    still = np.kron(sums / 4, np.ones((2, 2))) * WINDOW / 128
    assert np.mean((left - truth) ** 2) < np.mean((still - truth) ** 2) / 4


def test_the_gain_is_the_error_that_halves_take_away():
    """Light that goes from .6 to .2 in the middle: an error of counts in closed form, summed over
    windows of 41 cycles within the packet and those beyond its ends."""
    rate = np.where(np.arange(256) < 128, 0.6, 0.2)
    planes = np.diff(np.floor(np.cumsum(rate)), prepend=0) > 0
    words = np.zeros((8, 8, 8), np.uint32)
    for n in np.flatnonzero(planes):
        words[n // 32] |= np.uint32(1 << n % 32)
    upto = np.pad(np.cumsum(rate - rate.mean()), WINDOW)
    expected = 64 * ((upto[WINDOW:] - upto[:-WINDOW]) ** 2).sum()
    assert through(words, 256)[2] == pytest.approx(expected, rel=0.15)
