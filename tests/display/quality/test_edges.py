"""Blur: widths of edges known in closed form, and what noise does to them.

When light passes half of its step: packets, holds and emitters that take their time.
"""

import numpy as np
import pytest

from display.quality.edges import (
    STEP_SHARE,
    bet,
    blur_edge_width,
    cmr_like,
    ebet,
    fallen,
    half_way,
    mprt,
    relaxed,
    risen,
)

SPEED = 4000.0


def pursued(weight, shift, x, aperture=0.0):
    """Profile of an edge shown with `weight` of light while it is `shift` off the retina's place,
    seen through pixels of `aperture`."""
    at = x[:, None] - shift[None, :]
    if aperture == 0:
        return (weight * (at >= 0)).sum(axis=1) / weight.sum()
    return (weight * np.clip(at / aperture + 0.5, 0, 1)).sum(axis=1) / weight.sum()


@pytest.mark.parametrize(("hold", "rate"), [(1.0, 60), (1.0, 120), (0.03, 60)])
def test_a_hold_of_t_has_bet_0_8_t_and_ebet_t(hold, rate):
    time = (np.arange(1000) + 0.5) / 1000 * hold / rate
    shift = SPEED * (time - time.mean())
    x = np.linspace(-80, 80, 8001)
    blur = bet(blur_edge_width(x, pursued(np.ones(1000), shift, x)), SPEED)
    assert blur == pytest.approx(0.8 * hold / rate, rel=2e-3)
    assert ebet(blur) == pytest.approx(hold / rate, rel=2e-3)


def test_an_impulse_of_half_a_millisecond_has_ebet_half_a_millisecond():
    time = (np.arange(1000) + 0.5) / 1000 * 0.5e-3
    x = np.linspace(-3, 3, 6001)
    profile = pursued(np.ones(1000), SPEED * (time - time.mean()), x)
    assert ebet(bet(blur_edge_width(x, profile), SPEED)) == pytest.approx(0.5e-3, rel=2e-3)


def test_an_exponential_emitter_has_ln_9_time_constants():
    late = np.linspace(0, 20, 200_001)  # 1 - exp(-u) is 0.1 and 0.9 apart by ln 9
    assert blur_edge_width(late, 1 - np.exp(-late), 0.0, 1.0) == pytest.approx(np.log(9), rel=1e-4)


def test_falling_edges_and_any_units_of_light_are_alike():
    x = np.arange(100.0)
    up = np.clip((x - 40) / 20, 0, 1)
    assert blur_edge_width(x, up) == pytest.approx(16)
    assert blur_edge_width(x, 3 - 0.18 * up) == pytest.approx(16)


def test_an_edge_between_two_samples_is_interpolated():
    x = np.arange(10.0)
    assert blur_edge_width(x, (x >= 5).astype(float)) == pytest.approx(0.8)


def test_noise_hardly_moves_a_width():
    rng = np.random.default_rng(1)
    x = np.arange(400.0)
    clean = np.clip((x - 150) / 100, 0, 1)
    widths = [blur_edge_width(x, clean + rng.normal(0, 0.1, 400)) for _ in range(50)]
    assert np.mean(widths) == pytest.approx(80, abs=8)
    # The first sample beyond a level of the raw profile would be far off.
    assert all(60 < width < 110 for width in widths)


def test_mprt_is_told_in_both_conventions():
    times = [bet(w, SPEED) for w in (52.0, 54.0)]
    assert mprt(times) == pytest.approx(53 / SPEED)
    assert ebet(mprt(times)) == pytest.approx(53 / SPEED / STEP_SHARE)


def test_cmr_like_of_a_60_hz_hold_is_100():
    assert cmr_like(1 / 60) == pytest.approx(100)
    assert cmr_like(0.5e-3) == pytest.approx(100 / 60 / 0.5e-3)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: blur_edge_width([0, 1, 2, 3], [1, 1, 1, 1]), "have a step"),
        (lambda: blur_edge_width([0, 1, 1, 3], [0, 0, 1, 1]), "at increasing positions"),
        (lambda: blur_edge_width([0, 1, 2], [0, 0, 1]), "4 or more levels"),
        (lambda: blur_edge_width(np.arange(9), np.linspace(0.3, 1, 9), 0.0, 1.0), "run through"),
        (lambda: bet(3, 0), "speed must be positive"),
        (lambda: mprt([]), "at least one transition"),
        (lambda: cmr_like(0), "EBET must be positive"),
    ],
)
def test_what_cannot_be_measured_is_refused(call, says):
    with pytest.raises(ValueError, match=says):
        call()


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
