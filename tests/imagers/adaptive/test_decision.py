"""Decisions of the adaptive exposure: table, searches, limits, and what the loop makes of them."""

from __future__ import annotations

import numpy as np
import pytest

from imagers.adaptive.device.decision import (
    LONGEST,
    MULTIPLIER_BITS,
    PRINTED_MULTIPLIER_BITS,
    Search,
    Statistics,
    Window,
    decide,
    gather,
    lengthening,
    shortened,
)
from imagers.adaptive.device.loop import (
    brightest_lux,
    combined_response,
    darkest_lux,
    exponential_deviation,
    follow,
    from_judged,
    light_for,
    longest_exposure,
    recovery,
    search_path,
    settled,
    shortest_exposure,
    worst_search,
)
from imagers.adaptive.pixels import CmosSetting
from tests.imagers.adaptive.naive_rules import from_register, unlimited


def test_the_table_is_the_highest_set_bit() -> None:
    assert [lengthening(v) for v in (255, 128, 127, 64, 63, 32, 16, 8, 4, 3, 2, 1, 0)] == [
        1, 1, 2, 2, 4, 4, 8, 16, 32, 64, 64, 128, 256,
    ]  # fmt: skip
    for value in range(1, 256):  # never beyond the scale, always to half of it
        assert 128 <= value * lengthening(value) < 256


def test_searches_take_4_3_and_21_frames() -> None:
    assert [len(search_path(search)) - 1 for search in Search] == [4, 3, 21]
    exponents = [m.bit_length() - 1 for m in search_path(Search.PART)]
    assert exponents == [24, 16, 8, 0, 3]
    assert [m.bit_length() - 1 for m in search_path(Search.ROOT)] == [24, 12, 6, 3]


def test_in_the_pipeline_a_search_takes_two_frames_a_decision() -> None:
    for search in Search:
        path = search_path(search)
        seen = follow([light_for(8)] * 60, from_judged(search, LONGEST), start=1 << 24)
        assert [s.multiplier for s in seen[: 2 * len(path)]] == [m for m in path for _ in (0, 1)]
        assert {s.multiplier for s in seen[2 * len(path) :]} == {8}


def test_a_fall_of_256_is_followed_in_one_frame_and_to_a_256th_lsb_in_two() -> None:
    """Light is given by the value (with its fraction) at the exposure before."""
    setting, start = CmosSetting(), 1

    def decisions(value: float) -> int:
        lux, multiplier, count = light_for(start, value), start, 0
        while True:
            dn, saturated = setting.value(lux, multiplier * shortest_exposure())
            assert not saturated
            made = decide(
                multiplier, 0, dn, threshold=0, search=Search.HALF, longest=LONGEST
            ).multiplier
            if made == multiplier:
                assert dn >= 128
                return count
            multiplier, count = made, count + 1

    for value in np.linspace(128, 255.9, 60):
        assert decisions(value / 256) == 1  # 1/2 LSB and more
        assert decisions(value) == 0
    for value in np.geomspace(0.5, 127.9, 80):
        assert decisions(value) == 1
    for value in np.geomspace(1 / 256, 0.4999, 80):
        assert decisions(value) == 2
    assert decisions(1 / 512) == 2 and decisions(1 / 513) == 3


def test_the_multiplier_of_2_to_the_24_needs_a_25th_bit() -> None:
    assert (1 << 24).bit_length() == MULTIPLIER_BITS == PRINTED_MULTIPLIER_BITS + 1
    assert (1 << 24) * shortest_exposure() == pytest.approx(16.777216)


def test_shortening_stays_a_power_of_two_and_within_the_limits() -> None:
    for search in Search:
        assert shortened(1, search) == 1
        for m in (*range(2, 3000), 1 << 24, (1 << 24) - 1):
            made = shortened(m, search)
            assert made.bit_count() == 1 and 1 <= made < m
    made = decide(1 << 16, 0, 0, threshold=0, search=Search.PART, longest=16)
    assert made == (1 << 16, False)
    made = decide(1 << 20, 3, 0, threshold=2, search=Search.HALF, longest=16)
    assert made == (1 << 16, True)  # a limit that was lowered is kept to
    assert decide(100, 0, 150, threshold=0, search=Search.PART) == (100, False)  # a user's own
    assert decide(100, 0, 100, threshold=0, search=Search.PART) == (128, False)
    assert decide(64, 9, None, threshold=9, search=Search.PART) == (64, False)  # nothing to go by


def test_statistics_are_those_of_a_loop_over_pixels() -> None:
    rng = np.random.default_rng(7)
    for _ in range(50):
        values = rng.integers(0, 256, (9, 11)).astype(np.uint16)
        saturated = (values == 255) & (rng.random((9, 11)) < 0.5) | (rng.random((9, 11)) < 0.3)
        top, left = rng.integers(0, 9), rng.integers(0, 11)
        window = Window(top, rng.integers(top, 12), left, rng.integers(left, 14))
        for whole in (False, True):
            count, largest = 0, -1
            for row in range(9):
                for column in range(11):
                    inside = window.top <= row <= window.bottom
                    inside = inside and window.left <= column <= window.right
                    count += bool(inside and saturated[row, column])
                    if (inside or whole) and not saturated[row, column]:
                        largest = max(largest, int(values[row, column]))
            expected = Statistics(count, None if largest < 0 else largest)
            assert gather(values, saturated, window, whole_scan=whole) == expected


def test_light_from_a_tenth_to_a_million_lux_rests_unsaturated() -> None:
    assert longest_exposure() == pytest.approx(65.536e-3) and shortest_exposure() == 1e-6
    assert brightest_lux() == pytest.approx(1e6) and darkest_lux() < 0.1
    half = 128 * darkest_lux()  # below it, values stay below half scale at the longest exposure
    assert half == pytest.approx(128 / 256 / 65.536e-3)
    for search in Search:
        rule = from_judged(search)
        for lux in np.geomspace(0.1, 1e6, 71):
            for start in (1, 1 << 16):
                rest = settled(float(lux), rule, start=start)
                assert not rest.saturated and 1 <= rest.multiplier <= 1 << 16
                assert rest.value >= 128 or (rest.multiplier == 1 << 16 and rest.value >= 1)
                assert (rest.value >= 128) == (lux >= half)


def test_the_combined_response_is_close_to_an_exponential() -> None:
    """Figure 6(b): from 2^16 T down to 2^12 T. Within 3.0 % of an exponential, and what half a DN
    adds to it at half scale."""
    points = combined_response([*np.geomspace(light_for(1 << 16, 128.5), 244.0, 300)])
    assert points[0].exponent == 16 and points[-1].exponent == 12
    exponents = [p.exponent for p in points]
    assert exponents == sorted(exponents, reverse=True)
    assert [p.combined for p in points] == sorted(p.combined for p in points)
    ideal = np.sqrt(2 / (np.e * np.log(2))) - 1
    assert ideal < exponential_deviation(points) < ideal + 1 / 256
    assert points[-1].combined > 5 * 128


def extremes() -> list[tuple[list[float], int]]:
    """Light and number of its last change: steps of 1e7, no light, light that oscillates."""
    bright, dark = 9e5, 9e-2
    made = [([dark] * 20 + [bright] * 60, 20), ([bright] * 20 + [dark] * 60, 20)]
    made += [([bright] * 10 + [0.0] * 20 + [100.0] * 60, 30)]
    for period in range(1, 9):
        swing = [bright if n // period % 2 else dark for n in range(64)]
        made += [(swing + [100.0] * 60, 64)]
    return made


@pytest.mark.parametrize("search", list(Search))
def test_extremes_of_light_leave_the_loop_in_range(search: Search) -> None:
    """After any of them the light of the last change is found within the longest search there is,
    two frames a decision, and the two frames that were exposed before."""
    bound = 2 * worst_search(search) + 2
    for lux, change in extremes():
        seen = follow(lux, from_judged(search), start=1)
        assert all(1 <= s.multiplier <= 1 << 16 for s in seen)
        assert recovery(lux, change, from_judged(search), start=1) <= bound


def test_naive_loops_fail_at_them() -> None:
    lost = 0
    for lux, change in extremes():
        lost += recovery(lux, change, from_register(Search.PART), start=1) == len(lux) - change
    assert lost > 0  # a change followed twice: the loop never rests
    lux = [1e7] * 60 + [100.0] * 60  # brighter than the shortest exposure can take
    stuck = follow(lux, unlimited(Search.HALF), start=1 << 16)
    assert stuck[-1].multiplier == 0  # and never comes back
    assert recovery(lux, 60, from_judged(Search.HALF), start=1 << 16) <= 6
