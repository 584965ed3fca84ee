"""What full physics costs asynchronous pixels: every interval by itself, on the brightest
tile, times the intervals that the light of the whole array makes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import PS
from sensor.asynchronous.model import EventModel
from sensor.asynchronous.pixel.reference import follow
from sensor.asynchronous.plan.plan import EventPlan
from sensor.asynchronous.plan.verify import View

_FEW: Final = 8
_MANY: Final = 64
"""Intervals a pixel whose difference in time is the cost of one."""
_ENOUGH: Final = 5.0
"""Seconds of repeated calls after which no more are made."""


def least(call: Callable[[], object], calls: int) -> float:
    """Seconds: one call discarded, the least of some more."""
    call()
    spent: list[float] = []
    while len(spent) < calls and sum(spent) < _ENOUGH:
        begin = time.perf_counter()
        call()
        spent.append(time.perf_counter() - begin)
    return min(spent)


@dataclass(frozen=True, eq=False)
class Cost:
    """Time that the reference takes.

    Attributes:
        numbers: numbers of the pixels that were timed.
        intervals_timed: number of intervals of the longer call.
        each: time of an interval, s.
        pixel: time of a pixel, s.
        intervals: number of intervals of the whole array, as long as its light is known.
        seconds: time of all of them, s.
    """

    numbers: npt.NDArray[np.uint32]
    intervals_timed: int
    each: float
    pixel: float
    intervals: float
    seconds: float


def reference_cost(model: EventModel, view: View, plan: EventPlan, calls: int) -> Cost:
    """calls: that are timed, of which the least counts."""
    scene = plan.scene
    tile = int(np.argmax(scene.mean))
    numbers = np.flatnonzero(scene.tile_of == tile).astype(np.uint32)

    def call(intervals: int) -> int:
        run = follow(model, numbers, view.light, view.gain, view.pattern, view.until, intervals)
        return int(run.count.sum())

    few, many = (least(lambda n=n: call(n), calls) for n in (_FEW, _MANY))  # type: ignore[misc]
    # Fewer intervals than asked for are drawn all the same.
    each = max(many - few, 0.0) / (numbers.size * (_MANY - _FEW))
    pixel = max(few / numbers.size - _FEW * each, 0.0)
    lasts = (view.until - view.light.pieces[0].start) / PS
    intervals = float((scene.mean * scene.pixels).sum()) * lasts + scene.tile_of.size
    whole = pixel * scene.tile_of.size + each * intervals
    return Cost(numbers, call(_MANY), each, pixel, intervals, whole)
