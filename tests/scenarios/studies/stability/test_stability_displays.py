"""Cases 22 to 27: each catches the display that one would write first."""

from __future__ import annotations

import pytest

from tests.scenarios.studies.stability import naive_displays as naive
from tests.scenarios.studies.stability.naive_ways import (
    Way,
    ids,
    must_fail,
    must_hold_and_be_caught,
)

WAYS: list[Way] = [
    (22, naive.Float32Sums, 0.5),
    (23, naive.WrappingAge, 0.1),
    (23, naive.NoInterval, 0.1),
    (24, naive.SpikeAtTheStart, 0.1),
    (25, naive.DarkPlanes, 0.5),
    (26, naive.ExplicitEuler, 1e3),
    (27, naive.AtTheEdge, 0.1),
    (27, naive.AroundTheEdge, 0.1),
]


@pytest.mark.parametrize("way", WAYS, ids=ids(WAYS))
def test_a_naive_display_fails(way: Way) -> None:
    must_fail(way)


@pytest.mark.parametrize("number", range(22, 28))
def test_every_case_of_a_display_has_its_naive_one(number: int) -> None:
    must_hold_and_be_caught(number, WAYS)
