"""Cases 28 to 32: each catches the method that one would write first."""

from __future__ import annotations

from typing import Any

import pytest

from scenarios.stability import CASES
from tests.scenarios import naive_links as naive

WAYS = [
    (28, naive.printed_capacity, 1e-3),
    (29, naive.density_quadrature, 0.1),
    (30, naive.one_less_cdf, 0.5),
    (31, naive.products, 10),
    (32, naive.bytes_as_they_are, 10),
    (32, naive.one_disparity, 0.05),
]


@pytest.mark.parametrize(("number", "method", "least"), WAYS)
def test_a_naive_method_fails(number: int, method: Any, least: float) -> None:
    case = CASES[number]
    value = case.check(method, **case.quick)
    assert not case.holds(value)
    assert not value < least  # nor is it a near miss; no number at all is none


@pytest.mark.parametrize("number", range(28, 33))
def test_every_case_of_a_link_has_its_naive_one(number: int) -> None:
    assert number in {way[0] for way in WAYS} and CASES[number].measure(None, quick=True).holds
