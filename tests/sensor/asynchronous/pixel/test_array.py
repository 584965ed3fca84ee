"""The asynchronous pixel: closed forms, laws, rules, and that splitting changes nothing."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats

from cosim import PS, Clock, InputError, Light, Piece
from sensor.asynchronous.model import EventModel, Firings, latched
from sensor.asynchronous.pixel.array import AsynchronousPixels
from sensor.device.pattern import DevicePattern

GHZ = Clock(10**9)
FOREVER = 2**62


def model(threshold: int = 100, shortest: int = 1000, **more: Any) -> EventModel:
    return EventModel(threshold, more.pop("seed", 1), more.pop("clock", GHZ), shortest, **more)


def steady(levels: npt.ArrayLike, start: int = 0, stop: int = FOREVER) -> Light:
    plane = np.atleast_2d(np.asarray(levels, np.float32))
    return Light((Piece(start, stop, plane, plane),))


def expose(setting: EventModel, light: Light, stop: int, **more: Any) -> Firings:
    """Light in electrons a second."""
    return AsynchronousPixels(setting, light.shape, 1.0, **more).step(light, 0, stop)


def same(one: Firings, two: Firings) -> bool:
    names = ("pixel", "instant", "width", "exact", "level")
    return all(np.array_equal(getattr(one, n), getattr(two, n)) for n in names)


def nth(firings: Firings, n: int) -> Firings:
    """The n-th firing of every pixel that has so many, in order of pixels."""
    order = np.argsort(firings.pixel, kind="stable")
    counts = np.bincount(firings.pixel)
    starts = (np.cumsum(counts) - counts)[counts > n]
    return firings.take(order[starts + n])


# Closed forms, without noise.


@pytest.mark.parametrize("lux_like", [2.5e5, 3.1e7, 2.86e10])
def test_the_inner_rate_is_one_over_width_plus_dead_times(lux_like):
    """numerics suite 4: 1/(Q/light + t_d + t_r), over many spikes, to 1e-9."""
    setting = model(300, shot=False, delay=1300, reset=2700)
    light = float(np.float32(lux_like))
    period = 300 / light * PS + 1300 + 2700
    n = 4000
    fired = expose(setting, steady(light), int(n * period * 1.00001 + 1), most=10**6)
    assert len(fired) == n
    # Instants are rounded up to a picosecond.
    assert fired.instant[-1] == pytest.approx(n * period - 2700, rel=1e-9, abs=1.001)
    rate = (n - 1) / (fired.instant[-1] - fired.instant[0])
    assert rate == pytest.approx(1 / period, rel=1e-9 + 2 / (n * period))
    assert fired.exact == pytest.approx(300 / light * PS + 1300, rel=1e-12)


def test_a_ramp_fires_where_its_square_root_says():
    """Light from 0 to 1e6 e/s in a second gathers 5e5 t^2: spike k at sqrt(k Q / 5e5); falling, it
    gathers 1e6 t - 5e5 t^2."""
    q = 1001
    first, last = np.zeros((1, 1), np.float32), np.full((1, 1), 1e6, np.float32)
    k = np.arange(1, 500)
    rising = Light((Piece(0, PS, first, last),))
    fired = expose(model(q, shot=False), rising, PS)
    assert len(fired) == 499
    assert fired.instant == pytest.approx(np.sqrt(k * q / 5e5) * PS, rel=1e-12, abs=1.001)
    falling = Light((Piece(0, PS, last, first),))
    fired = expose(model(q, shot=False), falling, PS)
    assert len(fired) == 499
    # dt = dcharge / light: the last spike, in a thousandth of the light, is the worst known.
    light = np.sqrt(1 - k * q / 5e5)
    assert fired.instant == pytest.approx((1 - light) * PS, rel=1e-10, abs=1.001)


def test_a_flash_in_the_dark_is_not_missed():
    """numerics suite 9: 1 us of light in 10 s of dark brings its charge to the last electron."""
    dark, bright = np.zeros((1, 1), np.float32), np.full((1, 1), 1e9, np.float32)
    begin = 4 * PS + 12_345
    light = Light(
        (
            Piece(0, begin, dark, dark),
            Piece(begin, begin + 10**6, bright, bright),
            Piece(begin + 10**6, FOREVER, dark, dark),
        )
    )
    fired = expose(model(300, shot=False), light, 10 * PS)
    assert fired.instant.tolist() == [begin + k * 300_000 for k in (1, 2, 3)]


def test_darkness_is_silent_and_costs_nothing():
    for stop in (PS, 10**5 * PS):
        fired = expose(model(300), steady(np.zeros((4, 5))), stop)
        assert len(fired) == 0
        assert fired.work == 20


def test_the_shortest_width_holds_a_pixel_that_is_full_sooner():
    """3.5 ns of light for Q (Huang 2022 section 4.3) but 10 ns to read it: one spike each 10 ns
    plus the reset, and what arrives between is lost."""
    setting = model(100, 10_000, shot=False, reset=500)
    fired = expose(setting, steady(2.86e10), 10**7)
    assert (np.diff(fired.instant) == 10_500).all()
    assert (fired.exact == 10_000).all()
    just = expose(setting, steady(100 / 10.25e-9), 10**6)
    assert just.exact == pytest.approx(10_250, rel=1e-6)


def test_a_held_pixel_fires_whatever_the_light_does_then():
    bright, dark = np.full((1, 1), 1e12, np.float32), np.zeros((1, 1), np.float32)
    light = Light((Piece(0, 2000, bright, bright), Piece(2000, FOREVER, dark, dark)))
    assert expose(model(100, 10_000, shot=False), light, PS).instant.tolist() == [10_000]


def test_dead_time_loses_the_light_of_a_jump_inside_it():
    """The light jumps within the reset after the first spike: the second interval sees only the
    new one."""
    low, high = (np.full((1, 1), x, np.float32) for x in (1e9, 4e9))
    light = Light((Piece(0, 103_000, low, low), Piece(103_000, FOREVER, high, high)))
    fired = expose(model(100, shot=False, reset=5000), light, 140_000)
    assert fired.instant.tolist() == [100_000, 105_000 + 25_000]


# Laws.


def test_first_widths_follow_gamma_under_steady_and_changing_light():
    """Time rescaled by the light's integral: Gamma(Q), unlatched (KS, alpha 1e-6)."""
    q, n = 100, 20000
    plane = np.full((1, n), 1e6, np.float32)
    other = np.full((1, n), 4e6, np.float32)
    fired = nth(expose(model(q), steady(plane), 2 * 10**8), 0)
    assert len(fired) == n
    assert stats.kstest(fired.exact * 1e6 / PS, "gamma", args=(q,)).pvalue > 1e-6
    # Up in a ramp for 50 us, then a jump down: Lambda is quadratic, then linear.
    knee = 5 * 10**7
    light = Light((Piece(0, knee, plane, other), Piece(knee, FOREVER, plane, plane)))
    fired = nth(expose(model(q, seed=3), light, 2 * 10**8), 0)
    t = fired.exact / PS
    kink = knee / PS
    charge = np.where(
        t < kink,
        1e6 * t + 3e6 / kink * t * t / 2,
        2.5e6 * kink + 1e6 * (t - kink),
    )
    assert len(fired) == n
    assert stats.kstest(charge, "gamma", args=(q,)).pvalue > 1e-6


def test_readings_below_threshold_follow_the_binned_poisson_law():
    q, levels, n, mean = 300, 10, 40000, 260.0
    setting = model(q, longest=PS, levels=levels)
    fired = nth(expose(setting, steady(np.full((1, n), mean)), PS), 0)
    assert len(fired) == n
    observed = np.bincount(fired.level, minlength=levels + 1)
    p = [
        stats.poisson.cdf(high, mean) - stats.poisson.cdf(low - 1, mean)
        for low, high in (setting.electrons(level) for level in range(levels))
    ]
    expected = np.array([*p, stats.poisson.sf(q - 1, mean)]) * n
    many = expected > 5
    observed = np.append(observed[many], observed[~many].sum())
    expected = np.append(expected[many], expected[~many].sum())
    keep = expected > 0
    assert stats.chisquare(observed[keep], expected[keep] * n / expected[keep].sum()).pvalue > 1e-6
    read = fired.level < levels
    assert (fired.instant[read] == PS).all() and (fired.width[read] == 10**9).all()


def test_a_reading_is_the_floor_of_its_share():
    setting = model(300, longest=PS, levels=7, shot=False)
    for electrons in (0, 1, 42, 43, 128, 299):
        fired = expose(setting, steady([[electrons + 0.5]]), PS)
        assert fired.level.tolist() == [7 * electrons // 300]
        low, high = setting.electrons(int(fired.level[0]))
        assert low <= electrons <= high


def test_the_fixed_pattern_scales_light_and_adds_dark_current():
    shape, light = (40, 50), 2e6
    pattern = DevicePattern(prnu=0.1, dark=1e5, dsnu=0.3, device_seed=7)
    fired = expose(model(1000, shot=False), steady(np.full(shape, light)), 10**9, pattern=pattern)
    first = nth(fired, 0)
    fixed = pattern.at(np.arange(2000, dtype=np.uint32))
    rate = light * fixed.gain + fixed.dark
    assert first.exact == pytest.approx(1000 / rate * PS, rel=1e-12)


def test_pixels_and_spikes_draw_apart():
    """Correlation of neighbours' and of consecutive widths: within 4.9 standard errors of zero."""
    fired = expose(model(50), steady(np.full((1, 5000), 1e6)), 30 * 50 * 10**6)
    one, two = nth(fired, 3), nth(fired, 4)
    n = len(one)
    assert n == 5000
    for a, b in ((one.exact[:-1], one.exact[1:]), (one.exact, two.exact)):
        assert abs(np.corrcoef(a, b)[0, 1]) < 4.9 / np.sqrt(n)


# The clock.


@pytest.mark.parametrize("tick", [1000, 1250, 10_000])
def test_instants_and_widths_are_latched_by_the_clock(tick):
    """A tick holds what fires after its first edge up to its second; a width is the ticks from the
    one in which it began to the one in which it ended."""
    fast, slow = Clock(PS), Clock(PS // tick)
    kwargs = {"delay": 100, "reset": 4321}
    fine = expose(model(30, 10_000, clock=fast, **kwargs), steady(np.full((1, 20), 9e8)), 10**7)
    coarse = expose(model(30, 10_000, clock=slow, **kwargs), steady(np.full((1, 20), 9e8)), 10**7)
    assert np.array_equal(fine.instant, coarse.instant)
    assert np.array_equal(fine.exact, coarse.exact)
    for pixel in range(20):
        mine = coarse.pixel == pixel
        ends = -(-coarse.instant[mine] // tick)
        begins = np.concatenate([[0], coarse.instant[mine][:-1] + 4321])
        assert np.array_equal(coarse.width[mine], ends - -(-begins // tick))
        assert np.array_equal(latched(coarse.instant[mine], tick), ends - 1)
    assert (coarse.width >= 1).all()
    # A clock at a random phase counts without bias: the mean error is a tick over sqrt(6 n).
    later = coarse.instant > 10**6
    error = coarse.width[later] * tick - coarse.exact[later]
    assert abs(error.mean()) < 4.9 * tick / np.sqrt(6 * later.sum())
    assert np.abs(error).max() <= tick


# The first-spike rule.


def first_spikes(firings: Firings, bound: float) -> npt.NDArray[np.bool_]:
    """The rule, spike by spike, in the plainest way. bound: relative."""
    keep = np.zeros(len(firings), np.bool_)
    sent: dict[int, float] = {}
    for n, (pixel, width) in enumerate(
        zip(firings.pixel.tolist(), firings.exact.tolist(), strict=True)
    ):
        last = sent.get(pixel)
        if last is None or abs(width - last) > bound * last:
            keep[n], sent[pixel] = True, width
    return keep


def test_where_stretches_are_short_the_rule_takes_the_same_spikes():
    """Reports more often than one in 256 are found spike by spike, from the same draws."""
    light = steady(np.full((1, 50), 1e6))
    everything = expose(model(100), light, 300 * 10**8)
    changes = expose(model(100, change=2.0), light, 300 * 10**8)
    assert same(changes, everything.take(first_spikes(everything, 0.2)))


@pytest.mark.parametrize(("q", "change", "held"), [(100, 4.0, 0.0), (1, 6.0, 0.0), (30, 3.0, 0.9)])
def test_skipped_stretches_follow_the_law_of_the_spikes_in_them(q, change, held):
    """Second reports and counts of reports, skipping against spike by spike: two-sample KS on
    unlatched times. The light falls to a twentieth once, so that what a stretch leaves at the
    end of a piece counts as well. alpha 1e-6 each."""
    n, lux = 400, 1e6
    mean = q / lux * PS
    knee, stop = round(1500.3 * mean), round(1700 * mean)
    high, low = (np.full((1, n), x, np.float32) for x in (lux, lux / 20))
    light = Light((Piece(0, knee, high, high), Piece(knee, FOREVER, low, low)))
    rules = {"shortest": round(held * mean) or 1000, "reset": 500, "delay": 300}
    everything = expose(model(q, seed=1, **rules), light, stop)
    slow = everything.take(first_spikes(everything, change / np.sqrt(q)))
    fast = expose(model(q, seed=2, change=change, **rules), light, stop)
    assert fast.work < everything.work / 4
    counts = [np.bincount(f.pixel, minlength=n) for f in (slow, fast)]
    assert stats.ks_2samp(*counts).pvalue > 1e-6
    before = [nth(f.take(f.instant <= knee), 1) for f in (slow, fast)]
    after = [nth(f.take(f.instant > knee), 0) for f in (slow, fast)]
    for one, two in (before, after):
        assert len(one) > 20
        assert stats.ks_2samp(one.instant, two.instant).pvalue > 1e-6
        assert stats.ks_2samp(one.exact, two.exact).pvalue > 1e-6


def test_skipped_readings_follow_their_law():
    """A dark pixel that is read again and again: levels beyond the bound come as rarely and as far
    out with skipping as one by one."""
    n, stop = 300, 800 * 10**9
    light = steady(np.full((1, n), 3e4))
    rules = {"longest": 10**9, "levels": 100, "reset": 1000}
    everything = expose(model(100, seed=1, **rules), light, stop)
    keep = np.zeros(len(everything), np.bool_)
    sent = np.full(n, -1)
    for i, (p, level) in enumerate(
        zip(everything.pixel.tolist(), everything.level.tolist(), strict=True)
    ):
        if sent[p] < 0 or abs(level - sent[p]) > 3.6 * np.sqrt(sent[p] + 0.5):
            keep[i], sent[p] = True, level
    slow = everything.take(keep)
    fast = expose(model(100, seed=2, change=3.6, **rules), light, stop)
    assert fast.work < everything.work / 4
    counts = [np.bincount(f.pixel, minlength=n) for f in (slow, fast)]
    assert counts[0].mean() > 1.2
    assert stats.ks_2samp(*counts).pvalue > 1e-6
    one, two = nth(slow, 1), nth(fast, 1)
    assert stats.ks_2samp(one.level, two.level).pvalue > 1e-6
    assert stats.ks_2samp(one.instant, two.instant).pvalue > 1e-6


def test_work_depends_on_reports_not_on_how_long_or_how_bright():
    setting = model(300, 10_000, longest=10**10, levels=100, change=8.0)
    dark = [expose(setting, steady(np.full((1, 50), 5.0)), s * PS).work for s in (1, 10**5)]
    # 1e5 s are 1e7 readings a pixel; a few more of them happen to be sent.
    assert dark[1] < 3 * dark[0]
    bright = model(300, 10_000, change=9.0)
    sun = [
        expose(bright, steady(np.full((1, 50), 2.86e10)), s).work for s in (10**9, 10**15)
    ]  # 1e5 and 1e11 spikes a pixel
    assert sun[1] < 10 * sun[0]
    assert sun[1] < 10_000


# Splitting.


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


@pytest.mark.parametrize("change", [0.0, 1.5, 4.0])
@pytest.mark.parametrize("longest", [0, 20_000_000])
def test_any_split_of_the_run_and_any_tiling_give_the_same_bits(change, longest):
    setting = model(
        200,
        10_000,
        change=change,
        longest=longest,
        levels=20 if longest else 1,
        reset=700,
        delay=90,
    )
    light, stop = mixed_light(), 10**9
    whole = expose(setting, light, stop, most=10**7)
    assert len(whole) > 200
    rng = np.random.default_rng(1)
    cuts = [0, *sorted(rng.integers(1, stop, 25).tolist()), stop]
    split = AsynchronousPixels(setting, light.shape, 1.0, tile=7, most=10**7)
    parts = [split.step(light, a, b) for a, b in pairwise(cuts)]
    for part, end in zip(parts, cuts[1:], strict=False):
        assert (part.instant <= end).all()
    assert same(Firings.join(parts), whole)


# What is refused.


def test_too_many_events_are_refused_before_they_fill_the_memory():
    with pytest.raises(InputError, match="the events must be at most 100,000, not more; shorten"):
        expose(model(), steady(np.full((1, 100), 1e9)), 10 * PS, most=100_000)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"threshold": 0}, "threshold"),
        ({"clock": Clock(3 * 10**9)}, "whole picoseconds"),
        ({"shortest": 999}, "shortest width"),
        ({"longest": 999}, "longest"),
        ({"levels": 3}, "levels"),
        ({"change": float("nan")}, "change"),
        ({"reset": -1}, "reset"),
    ],
)
def test_a_model_that_cannot_be_is_refused(more, says):
    with pytest.raises(ValueError, match=says):
        model(**more)


def test_light_of_another_shape_or_below_zero_is_refused():
    pixels = AsynchronousPixels(model(), (2, 2), 1.0)
    with pytest.raises(ValueError, match="must fall on"):
        pixels.step(steady(np.ones((2, 3))), 0, PS)
    with pytest.raises(ValueError, match="0 or more"):
        pixels.step(steady(np.full((2, 2), -1.0)), 0, PS)
