"""Cases 28 to 32: each catches the method that one would write first."""

from __future__ import annotations

import pytest

from tests.scenarios.studies.stability import naive_links as naive
from tests.scenarios.studies.stability.naive_ways import (
    Way,
    ids,
    must_fail,
    must_hold_and_be_caught,
)

WAYS: list[Way] = [
    (28, naive.printed_capacity, 1e-3),
    (29, naive.density_quadrature, 0.1),
    (30, naive.one_less_cdf, 0.5),
    (31, naive.products, 10),
    (32, naive.bytes_as_they_are, 10),
    (32, naive.one_disparity, 0.05),
]


@pytest.mark.parametrize("way", WAYS, ids=ids(WAYS))
def test_a_naive_method_fails(way: Way) -> None:
    must_fail(way)


@pytest.mark.parametrize("number", range(28, 33))
def test_every_case_of_a_link_has_its_naive_one(number: int) -> None:
    must_hold_and_be_caught(number, WAYS)
