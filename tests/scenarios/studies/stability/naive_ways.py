"""What is asked of every naive method, whatever its case is about."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from scenarios.studies.stability import CASES

Way = tuple[int, Any, float]
"""A case's number, a naive method, and the least value that it must come to."""


def must_fail(way: Way) -> None:
    """A case's own check on a naive method, which its own rule must refuse by far."""
    number, method, least = way
    case = CASES[number]
    value = case.check(method, **case.quick)
    assert not case.holds(value)
    assert not value < least  # nor is it a near miss; no number at all is none


def must_hold_and_be_caught(number: int, ways: Iterable[Way]) -> None:
    """What ships holds, and there is a naive method that does not."""
    assert number in {way[0] for way in ways} and CASES[number].measure(None, quick=True).holds


def ids(ways: Iterable[Way]) -> list[str]:
    """Names of tests, of a case and its method."""
    return [f"{number}-{method.__name__}" for number, method, _ in ways]
