"""The course of a block's spikes within a packet, and trains that follow it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from cosim.spikes.viform import unpack_planes
from sensor.codec.packets.layered import LAYERS, Layered
from sensor.codec.packets.midpoints import ONE, course_of, spikes_up_to, time_of
from tests.sensor.codec.packets.test_spans import moving_edge, windows


@pytest.mark.parametrize("cycles", [33, 64, 100, 128, 512])
def test_a_time_comes_back_from_its_count(cycles):
    rng = np.random.default_rng(cycles)
    spans = rng.integers(1, 400, (-(-cycles // 32), 2, 3)).astype(np.int32)
    course, _ = course_of(spans, cycles)
    assert np.array_equal(course[..., -1], spans.sum(axis=0))
    for t in range(cycles):
        assert time_of(course[1, 2], spikes_up_to(course[1, 2], t, cycles), cycles) == t
    assert time_of(course[0, 0], 0, cycles) == 0
    assert time_of(course[0, 0], course[0, 0, -1] << ONE, cycles) == cycles - 1


def test_a_count_is_linear_within_a_word():
    course, _ = course_of(np.array([64, 0, 32, 10], np.int32)[:, None, None], 100)
    expected = [*(2 * (np.arange(32) + 0.5)), *([64] * 32), *(64 + np.arange(32) + 0.5)]
    expected += [*(96 + 2.5 * (np.arange(4) + 0.5))]
    found = [spikes_up_to(course[0, 0], t, 100) / 2**ONE for t in range(100)]
    assert found == pytest.approx(expected, abs=2**-ONE)


def test_even_blocks_do_not_change():
    even = np.array([[32, 7, 0], [32, 7, 0], [32, 8, 0], [4, 1, 0]], np.int32)[:, None, :]
    assert not course_of(even, 100)[1].any()
    even[0, 0, 0] += 2
    assert course_of(even, 100)[1].tolist() == [[True, False, False]]


def test_no_layer_makes_a_moving_edge_worse():
    words = moving_edge(256)
    data, errors = [layer.data for layer in Layered().encode(words, 256)], []
    truth = windows(unpack_planes(words, 0, 256))
    for n in range(1, LAYERS + 1):
        left = Layered().decode(data[:n], (32, 32), 256)
        assert np.bitwise_count(left).sum() == np.bitwise_count(words).sum()
        errors.append(np.mean((windows(unpack_planes(left, 0, 256)) - truth) ** 2))
    assert errors[-1] == 0
    assert all(fine < coarse for coarse, fine in itertools.pairwise(errors)), errors
