"""Rates of blocks along a drifting phase, against what single rates would do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from link.coding import AdaptiveBlocks, blocks_of
from link.layout import TRAINING, Layout
from link.mode import EVERY_RATE, RATES, Mode
from link.setup.adapting import Course, plan_rates
from link.setup.choosing import Trial, choose, foresee
from link.theory import ldpc_word_error

HZ = 40_000.0
MODE = Mode(960, 960, 2, 1, "scrambled", None, adaptive=True)
DELAYS = tuple(n / 8 for n in range(9))
INFORMATION = (0.997, 0.99, 0.98, 0.95, 0.9, 0.8, 0.73, 0.93, 0.997)
"""Of one turn of phase."""


def single(rate: float) -> Mode:
    return Mode(960, 960, 2, 1, "scrambled", None, rate)


def same(information: float) -> float:
    return information


def test_the_least_information_of_a_span_is_found_over_turns() -> None:
    course = Course(DELAYS, INFORMATION, 1e-3)
    assert course.least(0, 0) == pytest.approx(0.997 - 0.067 * 0.03 / 0.125, abs=1e-3)
    assert course.least(700, 800) == pytest.approx(0.73)  # the minimum lies within
    assert course.least(2700, 2800) == pytest.approx(course.least(700, 800))
    back = Course(tuple(-d for d in DELAYS), INFORMATION, -1e-3)
    assert back.least(2700, 2800) == pytest.approx(0.73)
    part = Course((0.0, 0.1), (0.9, 0.8), 1e-3)  # less than a turn: no further than its end
    assert part.least(90, 500) == pytest.approx(0.8) and part.least(0, 0) < 0.9


def test_blocks_take_the_highest_rate_that_holds_at_their_phase() -> None:
    course = Course(DELAYS, INFORMATION, 1 / 2500)
    plan = plan_rates(MODE, course, same, 64_000_000, HZ, 0.05)
    form = blocks_of(Layout(MODE))
    length = form.groups * form.layout.group
    assert plan.frames < 0.01 and plan.overhead < 0.05
    for block, number in enumerate(plan.rates):
        begin = TRAINING + block * length
        information = course.least(begin, begin + length)
        assert ldpc_word_error(EVERY_RATE[number], information) < 0.05
        higher = [rate for rate in EVERY_RATE if rate > EVERY_RATE[number]]
        # a higher one would lose as many frames as it has more, or some other rate is between
        for rate in sorted(higher)[1:]:
            assert ldpc_word_error(rate, information) > 0.01
    assert {EVERY_RATE[n] for n in plan.rates} >= {0.65, 0.75, 0.84, 0.97}


def test_a_turn_of_phase_carries_more_than_any_one_rate() -> None:
    """Of one rate the worst phase counts."""
    course = Course(DELAYS, INFORMATION, 1 / 2500)
    size = 48_000_000  # a turn and more
    plan = plan_rates(MODE, course, same, size, HZ, 0.05)
    worst = min(INFORMATION)
    ones = [foresee(single(r), ldpc_word_error(r, worst), size, HZ, 0.05)[2] for r in RATES]
    two = Mode(960, 960, 2, 2, "scrambled", None, RATES[-1])
    ones.append(foresee(two, 0.0, size, HZ, 0.05)[2])
    assert plan.goodput > 1.6 * max(ones)
    mean = float(np.mean(np.interp(np.linspace(0, 1, 500), DELAYS, INFORMATION)))
    bits = Layout(MODE).cells * HZ
    assert 0.85 * mean * bits < plan.goodput < mean * bits


@pytest.mark.parametrize("information", [0.6, 0.75, 0.83, 0.9, 0.95, 0.985, 0.999])
@pytest.mark.parametrize("size", [1_000_000, 32_000_000])
def test_the_choice_is_never_slower_than_one_rate(information: float, size: int) -> None:
    """At a constant phase; below the lowest rate of the single ones, there is only this one."""
    trial = Trial(10**6, 10**3, 10**6, 10**3, information)
    ones = [single(rate) for rate in RATES]
    best = choose(lambda _: trial, ones, size=size, hz=HZ, most_overhead=0.05)
    both = choose(lambda _: trial, [*ones, MODE], size=size, hz=HZ, most_overhead=0.05)

    def goodput(choice):  # type: ignore[no-untyped-def]
        return max(row.goodput or 0.0 for row in choice.rows)

    assert both.holds and goodput(both) >= goodput(best)
    assert both.rates == () if not both.mode.adaptive else len(both.rates) > 0
    if information < 0.8:
        assert not best.holds and both.mode.adaptive
    alone = choose(lambda _: trial, [MODE], size=size, hz=HZ, most_overhead=0.05)
    form = blocks_of(Layout(MODE))
    assert isinstance(form, AdaptiveBlocks)
    if best.holds and size > 10**7:  # rounding to blocks apart
        assert goodput(alone) > 0.97 * goodput(best)


def test_hopeless_courses_have_no_goodput() -> None:
    plan = plan_rates(MODE, Course((0.0,), (0.3,), 0.0), same, 10**6, HZ, 0.05)
    assert plan.goodput == 0 and plan.overhead == math.inf
