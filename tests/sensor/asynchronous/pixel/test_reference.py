"""The asynchronous reference: closed forms, an independent sum for its quantiles, and the engine
beside it, interval by interval from the same draws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cosim import PS, Clock, Light, Piece
from sensor.asynchronous.model import EventModel
from sensor.asynchronous.pixel.array import AsynchronousPixels
from sensor.asynchronous.pixel.reference import follow, quantile_error
from sensor.asynchronous.plan.law import weak_error
from sensor.device.pattern import DevicePattern

GHZ = Clock(10**9)
FOREVER = 2**62


def model(threshold: int = 100, shortest: int = 1000, **more: Any) -> EventModel:
    return EventModel(threshold, more.pop("seed", 1), more.pop("clock", GHZ), shortest, **more)


def numbers(light: Light) -> np.ndarray:
    return np.arange(light.shape[0] * light.shape[1], dtype=np.uint32)


def mixed_light() -> Light:
    """Steady, rising, falling and dark pixels, with jumps."""
    rng = np.random.default_rng(5)
    planes = [rng.choice([0.0, 3e4, 1e6, 2e8], (3, 40)).astype(np.float32) for _ in range(3)]
    edges = [0, 200_000_123, 500_000_000, FOREVER]
    return Light(
        (
            Piece(edges[0], edges[1], planes[0], planes[1]),
            Piece(edges[1], edges[2], planes[1], planes[1]),
            Piece(edges[2], edges[3], planes[2], planes[2]),
        )
    )


def test_widths_and_instants_of_steady_light_are_the_quotient():
    plane = np.array([[2.5e5, 3.1e7, 9e9]], np.float32)
    light = Light((Piece(0, FOREVER, plane, plane),))
    setting = model(300, 40_000, shot=False, delay=1300, reset=2700)
    made = follow(setting, numbers(light), light, 1.0, None, 10**12, 5)
    width = np.maximum(300 / plane.ravel().astype(np.float64) * PS + 1300, 40_000)
    assert made.exact == pytest.approx(np.repeat(width[:, None], 5, 1), rel=1e-14)
    assert width[2] == 40_000
    ends = width[:, None] * np.arange(1, 6) + 2700 * np.arange(5)
    assert made.instant == pytest.approx(np.ceil(ends), abs=1.001)
    assert (made.count == 5).all() and made.sent.all() and (made.level == 1).all()
    assert (made.progress == 0).all()


def test_a_ramp_fires_where_its_square_root_says_and_stops_in_the_middle_of_an_interval():
    first, last = np.zeros((1, 1), np.float32), np.full((1, 1), 1e6, np.float32)
    light = Light((Piece(0, PS, first, last),))
    made = follow(model(1001, shot=False), numbers(light), light, 1.0, None, PS, 600)
    k = np.arange(1, 500)
    assert made.count[0] == 499
    assert made.instant[0, :499] == pytest.approx(np.sqrt(k * 1001 / 5e5) * PS, rel=1e-12, abs=2)
    # 5e5 electrons in all.
    assert made.progress[0] == pytest.approx(5e5 / 1001 - 499, rel=1e-9)


@pytest.mark.parametrize("q", [1, 3, 300, 20_000])
def test_thresholds_are_quantiles_of_the_law_added_up_in_sixty_digits(q):
    found = quantile_error(model(q), np.arange(max(2000 // q, 2), dtype=np.uint32))
    assert found < 1e-12


def test_the_check_of_quantiles_sees_a_part_in_1e9(monkeypatch):
    from sensor.asynchronous.pixel import reference

    plain = reference.exact_thresholds
    monkeypatch.setattr(reference, "exact_thresholds", lambda *given: plain(*given) * (1 + 1e-9))
    found = quantile_error(model(300), np.arange(4, dtype=np.uint32))
    assert found == pytest.approx(1e-9, rel=1e-3)


@pytest.mark.parametrize("shot", [False, True])
@pytest.mark.parametrize("longest", [0, 20_000_000])
def test_the_engine_goes_through_the_same_intervals(shot, longest):
    """Without noise to rounding; with it as well as the engine's table of thresholds is: it runs
    linearly over 1/128 of an octave, and falling light makes the most of an error."""
    light, stop = mixed_light(), 10**9
    setting = model(
        200, 10_000, shot=shot, longest=longest, levels=20 if longest else 1, reset=700, delay=90
    )
    pattern = DevicePattern(prnu=0.05, dark=2e4, dsnu=0.3, device_seed=3)
    fired = AsynchronousPixels(setting, light.shape, 1.0, pattern).step(light, 0, stop)
    made = follow(setting, numbers(light), light, 1.0, pattern, stop, 60)
    checked = 0
    for pixel in range(120):
        mine = fired.take(np.flatnonzero(fired.pixel == pixel)[:60])
        n = len(mine)
        assert made.count[pixel] == n
        checked += n
        assert np.array_equal(made.level[pixel, :n], mine.level)
        rel = 2e-5 if shot else 1e-12
        assert made.exact[pixel, :n] == pytest.approx(mine.exact, rel=rel, abs=2)
        assert made.instant[pixel, :n] == pytest.approx(mine.instant, rel=rel, abs=2)
        assert np.abs(made.width[pixel, :n] - mine.width * 1.0).max(initial=0) <= (6 if shot else 1)
    assert checked > 500


def test_what_is_sent_follows_the_rule():
    plane = np.full((1, 20), 1e6, np.float32)
    light = Light((Piece(0, FOREVER, plane, plane),))
    setting = model(100, change=1.5)
    made = follow(setting, numbers(light), light, 1.0, None, 10**11, 200)
    for pixel in range(20):
        last = None
        for width, sent in zip(made.exact[pixel], made.sent[pixel], strict=True):
            assert sent == (last is None or abs(width - last) > 0.15 * last)
            last = width if sent else last


@pytest.mark.parametrize("shortest", [1000, 10_000])
def test_unsent_stretches_have_the_mean_and_variance_of_their_spikes(shortest):
    """A weak error: 99.9 % intervals widened to alpha = 1e-6, 4.9 standard errors."""
    n = 1000
    found = weak_error(
        model(300, shortest, change=8.0), np.arange(n, dtype=np.uint32), np.full(n, 0.0286)
    )
    assert found is not None and found.pixels > 0.99 * n
    for engine, single, chance in (found.mean, found.variance):
        assert abs(engine) < 1.49 * chance
        assert abs(single) < 1.49 * chance
    assert found.mean[2] < 5e-4


def test_nothing_is_said_of_stretches_that_are_not_drawn():
    few = np.arange(4, dtype=np.uint32)
    assert weak_error(model(300), few, np.full(4, 1e-3)) is None
    assert weak_error(model(300, change=1.0), few, np.full(4, 1e-3)) is None
