"""When light passes half of its step: packets, holds and emitters that take their time."""

import numpy as np
import pytest

from display.quality.latency import fallen, half_way, relaxed, risen

EDGES = np.arange(9.0) * 25


def column(*levels):
    return np.array(levels, float)[:, None]


def test_the_first_packet_has_arrived_and_the_last_one_has_gone():
    light = column(0, 0, 1, 0, 0, 1, 0, 0)
    half = half_way(0, 0.25)
    assert risen(EDGES, light, half)[0] == 50
    assert fallen(EDGES, light, half)[0] == 150


def test_light_between_two_levels():
    light = column(0.2, 0.2, 0.2, 0.6, 1, 1, 1, 1)
    assert risen(EDGES, light, half_way(0.2, 1))[0] == 75
    assert fallen(EDGES, light[::-1].copy(), half_way(1, 0.2))[0] == 125


def test_what_never_comes_or_never_goes():
    dark, lit = column(*[0] * 8), column(*[1] * 8)
    assert np.isnan(risen(EDGES, dark, 0.5)[0]) and np.isnan(fallen(EDGES, lit, 0.5)[0])
    assert fallen(EDGES, dark, 0.5)[0] == EDGES[0] and risen(EDGES, lit, 0.5)[0] == EDGES[0]


@pytest.mark.parametrize("constant", [3.0, 25.0, 60.0])
def test_an_emitter_is_half_way_after_ln_2_time_constants(constant):
    up = column(0, 0, 1, 1, 1, 1, 1, 1)
    assert risen(EDGES, up, 0.5, rise=constant)[0] == pytest.approx(50 + constant * np.log(2))
    lit = column(1, 1, 1, 0, 0, 0, 0, 0)
    gone = fallen(EDGES, lit, 0.5, decay=constant)[0]
    assert gone == pytest.approx(75 + constant * np.log(2))


def test_a_packet_through_a_slow_emitter_that_never_reaches_half():
    light = column(0, 1, 0, 0, 0, 0, 0, 0)
    peak = 1 - np.exp(-25 / 100)
    assert relaxed(EDGES, light, 100, 100)[1].max() == pytest.approx(peak)
    assert np.isnan(risen(EDGES, light, peak * 1.01, 100, 100)[0])
    assert risen(EDGES, light, peak * 0.99, 100, 100)[0] < 50


def test_pixels_are_told_one_by_one():
    light = np.concatenate([column(0, 0, 1, 1, 1, 1, 1, 1), column(0, 0, 0, 0, 1, 1, 1, 1)], axis=1)
    np.testing.assert_allclose(risen(EDGES, light, 0.5), [50, 100])
    np.testing.assert_allclose(
        risen(EDGES, light, 0.5, rise=10), np.array([50, 100]) + 10 * np.log(2)
    )
