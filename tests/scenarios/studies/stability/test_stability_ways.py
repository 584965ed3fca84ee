"""Cases 22 to 38: each catches the display, the method or the control loop that one would write
first."""

from __future__ import annotations

from typing import Any

import pytest

from scenarios.studies.stability import CASES
from tests.imagers.ebaps import naive_loop
from tests.scenarios.studies.stability import naive_machines as naive

WAYS: list[tuple[int, Any, float]] = [
    (22, naive.Float32Sums, 0.5),
    (23, naive.WrappingAge, 0.1),
    (23, naive.NoInterval, 0.1),
    (24, naive.SpikeAtTheStart, 0.1),
    (25, naive.DarkPlanes, 0.5),
    (26, naive.ExplicitEuler, 1e3),
    (27, naive.AtTheEdge, 0.1),
    (27, naive.AroundTheEdge, 0.1),
    (28, naive.printed_capacity, 1e-3),
    (29, naive.density_quadrature, 0.1),
    (30, naive.one_less_cdf, 0.5),
    (31, naive.products, 10),
    (32, naive.bytes_as_they_are, 10),
    (32, naive.one_disparity, 0.05),
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
"""The number of a case, a naive method, and the least value that it must come to."""


@pytest.mark.parametrize(
    ("number", "method", "least"), WAYS, ids=[f"{way[0]}-{way[1].__name__}" for way in WAYS]
)
def test_a_naive_method_fails(number: int, method: Any, least: float) -> None:
    """A case's own check on a naive method, which its own rule must refuse by far."""
    case = CASES[number]
    value = case.check(method, **case.quick)
    assert not case.holds(value)
    assert not value < least  # nor is it a near miss; no number at all is none


@pytest.mark.parametrize("number", range(22, 39))
def test_every_case_has_its_naive_method_and_holds(number: int) -> None:
    assert number in {way[0] for way in WAYS} and CASES[number].measure(None, quick=True).holds
