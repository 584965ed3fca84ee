"""The layered code: every bit of any stream, and less of it layer by layer."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.spikes.viform import unpack_planes
from sensor.codec.columns import Damaged
from sensor.codec.packets.counts import pyramid, spread
from sensor.codec.packets.layered import LAYERS, SUM_LAYERS, Layered
from sensor.codec.packets.midpoints import find_spikes
from tests.sensor.codec.packets.streams import random_stream, steady

CODE = Layered()


def data_of(words, cycles):
    return [layer.data for layer in CODE.encode(words, cycles)]


def test_a_thousand_streams_come_back_bit_by_bit():
    for seed in range(1000):
        words, cycles = random_stream(seed)
        layers = CODE.encode(words, cycles)
        assert sum(layer.spikes for layer in layers) == np.bitwise_count(words).sum(), seed
        again = CODE.decode([layer.data for layer in layers], words.shape[1:], cycles)
        assert np.array_equal(again, words), seed


def test_any_first_layers_have_all_spikes_and_no_bits_outside():
    for seed in range(120):
        words, cycles = random_stream(seed)
        data, counts = data_of(words, cycles), np.bitwise_count(words).sum(axis=0)
        for n in range(1, LAYERS):
            left = CODE.decode(data[:n], words.shape[1:], cycles)
            found = np.bitwise_count(left).sum(axis=0)
            assert found.sum() == counts.sum(), (seed, n)
            if n >= len(SUM_LAYERS):
                assert np.array_equal(found, counts), (seed, n)
            if cycles % 32:
                assert not (left[-1] >> np.uint32(cycles % 32)).any(), (seed, n)


def test_what_is_filled_in_is_even():
    """Light that stays: from counts alone the spikes stand where a pixel of that rate fires, and no
    count in a window is wrong by more than one spike and the phase."""
    rate = np.linspace(0.05, 0.9, 96).reshape(8, 12)
    words = steady(rate, np.random.default_rng(0).random((8, 12)), 512)
    left = CODE.decode(data_of(words, 512)[:3], (8, 12), 512)
    error = np.cumsum(
        unpack_planes(left, 0, 512).astype(int) - unpack_planes(words, 0, 512), axis=0
    )
    assert 0 < np.abs(error).max() <= 2


def test_each_layer_takes_error_away():
    rng = np.random.default_rng(4)
    y, x = np.mgrid[:32, :32]
    rate = 0.3 + 0.2 * np.sin(x / 5) * np.cos(y / 7)
    words = steady(rate, rng.random((32, 32)), 256, 0.1)
    truth = unpack_planes(words, 0, 256).cumsum(axis=0).astype(int)
    data, errors = data_of(words, 256), []
    for n in range(1, LAYERS + 1):
        left = CODE.decode(data[:n], (32, 32), 256)
        gone = unpack_planes(left, 0, 256).cumsum(axis=0).astype(int) - truth
        errors.append(float(np.mean((gone[41:] - gone[:-41]) ** 2)))
    assert errors[-1] == 0
    assert all(fine < 0.97 * coarse for coarse, fine in itertools.pairwise(errors))


def test_the_gain_is_the_error_of_counts_that_a_layer_takes_away():
    """Of sums it is exact: 41^2 / cycles times the squared error of the counts of pixels."""
    words = steady(np.random.default_rng(5).random((16, 24)), 0.0, 128)
    counts, layers = np.bitwise_count(words).sum(axis=0).astype(np.int32), CODE.encode(words, 128)
    errors = [float(((counts - _even(level)) ** 2).sum()) for level in pyramid(counts)[::-1]]
    assert layers[1].gain == pytest.approx((errors[0] - errors[2]) * 41**2 / 128, rel=1e-3)
    assert layers[2].gain == pytest.approx((errors[2] - errors[3]) * 41**2 / 128, rel=1e-3)


def _even(sums):
    """Sums of whole blocks over their pixels, in fractions."""
    times = 24 // sums.shape[1]
    return np.kron(sums / times**2, np.ones((times, times)))


def test_steady_trains_cost_nothing_to_place_and_noise_costs_its_entropy():
    still = steady(np.full((64, 64), 0.25), 0.0, 128)
    assert sum(map(len, data_of(still, 128))) < 300
    noise = (np.random.default_rng(6).random((4, 64, 64)) * 2**32).astype(np.uint32)
    size = 8 * sum(map(len, data_of(noise, 128))) / (128 * 64 * 64)
    assert 1.0 < size < 1.09  # one bit a pixel and cycle, and 8 % for contexts that learn it


def test_an_empty_tile_takes_no_bytes():
    assert data_of(np.zeros((4, 64, 64), np.uint32), 128) == [b""] * LAYERS


def test_spikes_are_listed_in_order():
    words, _ = random_stream(11)
    times = np.empty(int(np.bitwise_count(words).sum()) + 1, np.int16)
    starts = np.empty(words[0].size + 1, np.int32)
    find_spikes(words, times, starts)
    planes = unpack_planes(words, 0, 32 * len(words)).reshape(32 * len(words), -1)
    expected = [np.flatnonzero(planes[:, p]) for p in range(planes.shape[1])]
    assert np.array_equal(times[: starts[-1]], np.concatenate(expected))
    assert np.array_equal(np.diff(starts), [len(e) for e in expected])


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 3), st.integers(0, 512))
def test_sums_are_spread_over_their_pixels(height, width, level, top):
    rng = np.random.default_rng(height * 41 + width)
    counts = rng.integers(0, top + 1, (height, width)).astype(np.int32)
    sums = pyramid(counts)[level]
    spread_out = spread(sums, (height, width))
    assert np.array_equal(pyramid(spread_out)[level], sums)
    assert spread_out.max() <= max(top, 1)


@given(st.integers(0, 10**6), st.integers(0, LAYERS - 1), st.binary(max_size=60))
def test_other_bytes_are_refused_or_decode_within_bounds(seed, layer, junk):
    words, cycles = random_stream(seed % 500)
    data = data_of(words, cycles)
    data[layer] = junk
    try:
        again = CODE.decode(data, words.shape[1:], cycles)
    except Damaged:
        return
    assert again.shape == words.shape
    if cycles % 32:
        assert not (again[-1] >> np.uint32(cycles % 32)).any()


@pytest.mark.parametrize("layers", [0, LAYERS + 1])
def test_layers_that_are_not_there_are_refused(layers):
    with pytest.raises(ValueError, match=f"layers must be 1 to 8, not {layers}"):
        Layered(layers)


def test_dim_areas_do_not_fire_all_at_once() -> None:
    """Two spikes of each pixel without their times: every cycle has as many of them."""
    words = np.zeros((4, 64, 64), np.uint32)
    words[0] = words[2] = 1 << 7
    layers = [layer.data for layer in Layered().encode(words, 128)][:3]
    planes = unpack_planes(Layered().decode(layers, (64, 64), 128), 0, 128)
    assert (planes.sum(axis=0) == 2).all()
    assert (planes.reshape(128, -1).sum(axis=1) == 64).all()
    near = planes.reshape(128, 8, 8, 8, 8).sum(axis=(2, 4))  # so has each block of 8 x 8 pixels
    assert (near == 1).all()
