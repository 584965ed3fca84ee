"""Cases 22 to 27: each catches the display that one would write first."""

from __future__ import annotations

from typing import Any

import pytest

from scenarios.stability import CASES
from tests.scenarios import naive_displays as naive

WAYS = [
    (22, naive.Float32Sums, 0.5),
    (23, naive.WrappingAge, 0.1),
    (23, naive.NoInterval, 0.1),
    (24, naive.SpikeAtTheStart, 0.1),
    (25, naive.DarkPlanes, 0.5),
    (26, naive.ExplicitEuler, 1e3),
    (27, naive.AtTheEdge, 0.1),
    (27, naive.AroundTheEdge, 0.1),
]


@pytest.mark.parametrize(("number", "method", "least"), WAYS)
def test_a_naive_display_fails(number: int, method: Any, least: float) -> None:
    case = CASES[number]
    value = case.check(method, **case.quick)
    assert not case.holds(value)
    assert not value < least  # nor is it a near miss; no number at all is none


@pytest.mark.parametrize("number", range(22, 28))
def test_every_case_of_a_display_has_its_naive_one(number: int) -> None:
    assert number in {way[0] for way in WAYS} and CASES[number].measure(None, quick=True).holds
