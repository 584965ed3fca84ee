"""Cases 33 to 38: each catches the control loop that one would write first."""

from __future__ import annotations

import pytest

from tests.imagers.ebaps import naive_loop
from tests.scenarios.studies.stability import naive_controls as naive
from tests.scenarios.studies.stability.naive_ways import (
    Way,
    ids,
    must_fail,
    must_hold_and_be_caught,
)

WAYS: list[Way] = [
    (33, naive.no_end, 1),
    (33, naive.twice_followed, 1),
    (34, naive.twice_followed, 1),
    (35, naive_loop.unclipped, 640_000),
    (35, naive_loop.proportional, 640_000),
    (36, naive_loop.unclipped, 640_000),
    (36, naive_loop.proportional, 640_000),
    (37, naive_loop.float32_sum, 1),
    (37, naive_loop.sum_of_32_bits, 1),
    (38, naive.wound_up, 2),
]


@pytest.mark.parametrize("way", WAYS, ids=ids(WAYS))
def test_a_naive_loop_fails(way: Way) -> None:
    must_fail(way)


@pytest.mark.parametrize("number", range(33, 39))
def test_every_case_of_a_loop_has_its_naive_one(number: int) -> None:
    must_hold_and_be_caught(number, WAYS)
