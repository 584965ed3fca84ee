"""How a benchmark is timed, and its row: the first call discarded, then the least of several."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["BRIGHT", "DARK", "REAL_TIME", "REPEATS", "Row", "least", "least_of"]

REPEATS = 5
REAL_TIME = 40e3
"""Latch cycles a second of SpikeTwo."""
DARK, BRIGHT = 0.03, 0.6
"""Spikes a cycle at the darkest and brightest pixel of the bench's picture."""


@dataclass(frozen=True)
class Row:
    """One benchmark; value in unit, realtime 1 = real time. plain_ratio: null where the plain way
    was not measured."""

    name: str
    tier: str
    value: float
    unit: str
    realtime: float | None
    ceiling_ratio: float | None
    plain_ratio: float | None


def least(call: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Seconds of the fastest of repeated calls, the first one discarded."""
    return least_of([call], repeats)[0]


def least_of(calls: list[Callable[[], Any]], repeats: int = REPEATS) -> list[float]:
    """The same of each, in turns, so that all meet the same load of the machine."""
    for call in calls:
        call()
    spent: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats):
        for call, times in zip(calls, spent, strict=True):
            begin = time.perf_counter()
            call()
            times.append(time.perf_counter() - begin)
    return [min(times) for times in spent]
