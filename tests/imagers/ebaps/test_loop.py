"""The exposure loop: the printed numbers, where it rests and where it hunts, and extremes."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imagers.ebaps.board.timing import Timing
from imagers.ebaps.device.exposure import DEFAULT_EXPOSURE, ExposureRule, Linear, follow
from imagers.ebaps.device.settling import (
    accumulated,
    dark_then_light,
    light_steps,
    settle,
    settling_exposure,
    shipped_loop,
    swinging,
)
from tests.imagers.ebaps import naive_loop as naive

RULE = ExposureRule()
EVERY = replace(RULE, wait=False)


def ends(rule: ExposureRule, light: Linear, frames: int = 240, **more: int) -> list[int]:
    """The last 16 exposures: two periods of the longest cycle."""
    return follow(rule, lambda frame, exposure: light.mean(exposure), frames, **more)[-16:]


def spans(rule: ExposureRule, light: Linear, steps: int = 1) -> bool:
    """Whether the window is at least so many steps wide under this light."""
    return light.slope * rule.step * steps <= rule.high - rule.low


def resting(
    rule: ExposureRule, start: int = DEFAULT_EXPOSURE, zero: int = 0
) -> list[tuple[Fraction, Fraction]]:
    """Ideal exposures (middle of the window), ns, for which the loop settles inside the window:
    closed intervals in order, adjacent ones joined."""
    low, high = rule.low - zero, rule.high - zero
    middle = Fraction(low + high, 2)
    start = rule.clip(start)
    points = {start, rule.shortest, rule.longest}
    points |= set(range(start, rule.shortest - 1, -rule.step))
    points |= set(range(start, rule.longest + 1, rule.step))
    merged: list[tuple[Fraction, Fraction]] = []
    for a, b in sorted((p * middle / high, p * middle / low) for p in points):
        if merged and a <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(b, merged[-1][1]))
        else:
            merged.append((a, b))
    return merged


def settling_share(
    rule: ExposureRule, first: int, last: int, start: int = DEFAULT_EXPOSURE
) -> Fraction:
    """Share of the ideal exposures between `first` and `last`, ns, for which the loop settles."""
    inside = Fraction(0)
    for a, b in resting(rule, start):
        inside += max(min(b, Fraction(last)) - max(a, Fraction(first)), Fraction(0))
    return inside / (last - first)


def test_the_printed_numbers() -> None:
    assert Timing().longest_exposure == 32_768_000
    assert (RULE.low, RULE.high, RULE.step, RULE.shortest) == (24_000, 25_600, 640_000, 1_000_000)
    assert RULE.longest == 32_768_000
    assert follow(RULE, lambda frame, exposure: 24_000, 1) == [16_384_000]


@pytest.mark.parametrize(
    ("total", "after"),
    [(23_999, 17_024_000), (24_000, 16_384_000), (25_600, 16_384_000), (25_601, 15_744_000)],
)
def test_one_step(total: int, after: int) -> None:
    assert RULE.after(16_384_000, total * 1000, 1000) == after


def test_one_dn_in_one_pixel_decides() -> None:
    pixels = 1280 * 1024
    assert RULE.side(24_000 * pixels, pixels) == 0
    assert RULE.side(24_000 * pixels - 1, pixels) == -1
    assert RULE.side(25_600 * pixels + 1, pixels) == 1


def test_it_clips_at_both_ends() -> None:
    up = follow(RULE, lambda frame, exposure: 0, 200)
    down = follow(RULE, lambda frame, exposure: 65_535, 200)
    assert max(up) == up[-1] == 32_768_000 and min(down) == down[-1] == 1_000_000
    # The last step before an end is a short one: 16.384 + 25 x 0.64 = 32.384 ms.
    assert sorted(set(up))[-2] == 32_384_000
    assert sorted(set(down))[1] == 1_024_000


def test_the_exposures_from_which_it_rests() -> None:
    assert settling_exposure(RULE) == 9_600_000
    assert settling_exposure(RULE, 24_800) == 9_920_000
    assert settling_exposure(RULE, steps=2) == 19_200_000
    # From the default exposure's grid, the last gap ends a little earlier.
    assert resting(RULE)[-1][0] == 9_672_000


@settings(max_examples=100, deadline=None)
@given(
    wanted=st.integers(300_000, 60_000_000),
    zero=st.integers(0, 20_000),
    start=st.integers(0, 40_000_000),
)
def test_simulation_ends_where_analysis_says(wanted: int, zero: int, start: int) -> None:
    light = Linear.wanting(wanted, RULE, zero)
    said = settle(RULE, light, start)
    last = ends(RULE, light, start=start)
    assert set(last) == {said.low, said.high}
    inside = [RULE.side(light.mean(e), 1) == 0 for e in last]
    assert all(inside) if said.kind == "rest" else not any(inside)
    if spans(RULE, light):
        assert said.kind != "hunt"
    if said.kind == "hunt":  # between a frame too dark and one too bright, a step apart, for ever
        assert said.high - said.low == RULE.step
        assert {RULE.side(light.mean(e), 1) for e in last} == {-1, 1}


def test_it_rests_wherever_the_window_spans_a_step() -> None:
    for wanted in range(9_920_000, 32_768_000, 97_003):
        light = Linear.wanting(wanted, RULE)
        assert spans(RULE, light)
        assert settle(RULE, light).kind == "rest", wanted


@pytest.mark.parametrize(("first", "last", "about"), [(1, 3, 0.25), (3, 6, 0.41), (9.95, 32, 1.0)])
def test_the_share_that_settles(first: float, last: float, about: float) -> None:
    a, b = int(first * 1e6), int(last * 1e6)
    exact = float(settling_share(RULE, a, b))
    assert exact == pytest.approx(about, abs=0.02)
    n = 400
    wanted = [a + (2 * k + 1) * (b - a) // (2 * n) for k in range(n)]
    rested = [len(set(ends(RULE, Linear.wanting(w, RULE), 160))) == 1 for w in wanted[::10]]
    kinds = [settle(RULE, Linear.wanting(w, RULE)).kind == "rest" for w in wanted]
    assert rested == kinds[::10]
    # A midpoint rule misses at most one sample an edge of an interval.
    edges = 2 * sum(a <= p * 1.04 and p * 0.96 <= b for p, _ in resting(RULE)) + 2
    assert abs(sum(kinds) / n - exact) <= edges / n


def test_acting_on_every_frame_needs_as_many_steps_as_frames_of_delay() -> None:
    hunted = 0
    for wanted in range(9_950_000, 31_000_000, 530_003):
        light = Linear.wanting(wanted, RULE)
        last = set(ends(EVERY, light))
        ideal = set(ends(EVERY, light, latency=1))
        assert len(ideal) == 1 and RULE.side(light.mean(min(ideal)), 1) == 0
        if spans(RULE, light, steps=2):
            assert len(last) == 1 and RULE.side(light.mean(min(last)), 1) == 0
        hunted += len(last) > 1
    assert hunted > 5  # so waiting is worth its frames


def test_no_step_and_a_window_turned_around_do_no_harm() -> None:
    assert set(follow(replace(RULE, step=0), lambda f, e: 0, 20)) == {16_384_000}
    odd = replace(RULE, low=30_000, high=20_000, shortest=5_000_000, longest=2_000_000)
    assert set(follow(odd, lambda f, e: f * 7919 % 65_536, 50)) == {2_000_000}
    assert settle(replace(RULE, step=0), Linear(Fraction(0))).kind == "end"


@pytest.mark.parametrize("check", [light_steps, dark_then_light, swinging])
def test_extremes_hold_and_refuse_the_naive(check: object) -> None:
    assert check(shipped_loop) == 0  # type: ignore[operator]
    assert check(naive.unclipped) > 0  # type: ignore[operator]
    assert check(naive.proportional) > 0  # type: ignore[operator]


def test_the_sum_of_a_frame() -> None:
    def shipped(frame: np.ndarray) -> int:
        return int(frame.sum(dtype=np.int64))

    assert accumulated(shipped) == 0
    assert accumulated(naive.float32_sum) > 0
    assert accumulated(naive.sum_of_32_bits) > 0


class TestTiming:
    def test_thirty_frames_a_second_for_ever(self) -> None:
        t = Timing()
        assert t.vsync(30) == 40_000_000 and t.vsync(30 * 86_400) == 40_000_000 * 86_400
        assert {t.vsync(k + 1) - t.vsync(k) for k in range(90)} == {1_333_333, 1_333_334}

    def test_blanking(self) -> None:
        assert Timing().blanking == pytest.approx(0.01696, abs=1e-5)
        with pytest.raises(ValueError, match="within its period"):
            Timing(clock_hz=39_000_000)

    def test_a_mean_comes_too_late_for_the_next_frame(self) -> None:
        t = Timing()
        for exposure in (1_000_000, 16_384_000, 32_768_000):
            assert t.rise(1, exposure) < t.ready(0) < t.vsync(2)

    def test_rows_follow_each_other_by_a_line(self) -> None:
        begin, end = Timing().row_times(3, 640_000, 5)
        assert (end - begin == 640_000_000).all()
        assert (np.diff(begin) == 32_000_000).all()
        assert end[0] == Timing().vsync(4) * 25_000
