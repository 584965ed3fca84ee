"""Timing of a benchmark: after one discarded call, the fastest of several counts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

REPEATS = 5
"""Timed calls of a benchmark, of which the fastest counts."""
REAL_TIME = 40e3
"""Latch cycles a second of SpikeTwo."""
DARK, BRIGHT = 0.03, 0.6
"""Spikes a cycle of the darkest and brightest pixel of the benchmark picture."""


@dataclass(frozen=True)
class TimingRow:
    """One benchmark.

    Attributes:
        name, tier: name of the benchmark, and its tier.
        value, unit: throughput; a time, s, or a size, B, where the name says so.
        realtime: throughput relative to real time, None if it has none.
        ceiling_ratio: throughput relative to the measured limit of the device, None if unknown.
        plain_ratio: throughput relative to the plain implementation, None if not measured.
        share: part of the time of all stages of a chain, 0 to 1; None where there are none.
    """

    name: str
    tier: str
    value: float
    unit: str
    realtime: float | None
    ceiling_ratio: float | None
    plain_ratio: float | None
    share: float | None = None


def least(
    call: Callable[[], Any], repeats: int = REPEATS, enough: float = math.inf
) -> float:  # fmt: skip
    """Seconds of the fastest of repeated calls, after one that is discarded. enough: seconds of
    these calls after which no more are made."""
    return least_of([call], repeats, enough=enough)[0]


def least_of(
    calls: list[Callable[[], Any]], repeats: int = REPEATS,
    clock: Callable[[], float] = time.perf_counter, enough: float = math.inf,
) -> list[float]:  # fmt: skip
    """`least` of each call. The calls take turns, so that all have the same load of the machine.
    clock: gives seconds; `time.process_time` for processor time."""
    for call in calls:
        call()
    spent: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats):
        if spent[0] and sum(map(sum, spent)) >= enough:
            break
        for call, times in zip(calls, spent, strict=True):
            begin = clock()
            call()
            times.append(clock() - begin)
    return [min(times) for times in spent]
