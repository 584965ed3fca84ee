"""Stability cases 33 to 38: the exposure loops of the imagers under light that steps by 1e7, goes
out or oscillates, and a cooler that cannot reach its target for half an hour."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from cosim.compute.opencl import Device
from cosim.run.case import Case
from imagers.adaptive.device.decision import Search
from imagers.adaptive.device.loop import follow, from_judged, recovery, worst_search
from imagers.ebaps.device.settling import (
    accumulated,
    dark_then_light,
    light_steps,
    shipped_loop,
    swinging,
)
from imagers.emccd.device.cooling import Cooler, run_cooling

Adaptive = Callable[[int], Any]
"""Number of a search, 1 to 3 -> `Rule` of the exposure selection (adaptive/device/loop.py)."""
_EXPONENT: Final = 16
"""Exponent of the longest exposure of the adaptive sensor, 2^16 us."""


def _adaptive(device: Device | None) -> Adaptive:
    return lambda search: from_judged(Search(search), _EXPONENT)


def _delay(rule_of: Adaptive, courses: list[tuple[list[float], int]]) -> float:
    """Largest number of frames by which the loop settles later than allowed: two frames for each
    decision of the longest search, and the two frames that were exposed before the change. Infinite
    if an exposure leaves the range of 1 us to 2^16 us.

    Args:
        rule_of: see `Adaptive`.
        courses: (lux of each frame, number of the frame of the last change) of each course.
    """
    worst = 0.0
    for search in Search:
        rule, most = rule_of(int(search)), 2 * worst_search(search, _EXPONENT) + 2
        for lux, change in courses:
            for start in (1, 1 << _EXPONENT):
                frames = follow(lux, rule, start=start)
                if not all(1 <= each.multiplier <= 1 << _EXPONENT for each in frames):
                    return math.inf
                worst = max(worst, recovery(lux, change, rule, start=start) - most)
    return worst


# 33 ------------------------------------------------------------------------------------------


def _steps() -> list[tuple[list[float], int]]:
    """Steps up and down by 1e7, within the range of the sensor and beyond it."""
    pairs = [(0.1, 1e6), (1e6, 0.1), (3.0, 3e7), (3e7, 3.0), (1e-3, 1e4), (1e4, 1e-3)]
    return [([before] * 60 + [after] * 80, 60) for before, after in pairs]


def adaptive_steps(rule_of: Adaptive) -> float:
    """See `_delay`."""
    return _delay(rule_of, _steps())


# 34 ------------------------------------------------------------------------------------------


def _none_and_swings(dark: int) -> list[tuple[list[float], int]]:
    """`dark` frames without light, then constant light; and light that alternates between 1e-1 and
    1e6 lux every 1 to 9 frames, or ever more slowly, then constant light."""
    courses = [([0.0] * dark + [after] * 80, dark) for after in (0.1, 30.0, 1e6, 1e9)]
    for turn in range(1, 10):
        swing = [(0.1, 1e6)[n // turn % 2] for n in range(300)]
        courses += [([*swing, *([after] * 80)], 300) for after in (1.0, 1e3)]
    growing = [1e6 if n % 2 else 0.1 for n in range(40) for _ in range(n + 1)]
    return [*courses, ([*growing, *([50.0] * 80)], len(growing))]


def adaptive_swings(rule_of: Adaptive, dark: int = 2000) -> float:
    """See `_delay`."""
    return _delay(rule_of, _none_and_swings(dark))


# 35, 36, 37 ----------------------------------------------------------------------------------


def _ebaps(device: Device | None) -> Any:
    return shipped_loop


def ebaps_steps(loop: Any) -> float:
    """Largest deviation of the exposure, ns, from its range or, between steps of 1e7, from the
    predicted end."""
    return float(light_steps(loop))


def ebaps_swings(loop: Any) -> float:
    """Largest deviation of the exposure, ns: from its range or the predicted end after 2000 dark
    frames, or beyond one step under oscillating light."""
    return float(max(dark_then_light(loop), swinging(loop)))


def _sum(device: Device | None) -> Any:
    """The sum of a frame that the loop uses."""
    return lambda frame: int(frame.sum(dtype=np.int64))


def ebaps_sum(total: Any) -> float:
    """Error of the sum of a whole frame, DN; an error of 1 changes a decision."""
    return float(accumulated(total))


# 38 ------------------------------------------------------------------------------------------

Cooled = Callable[[Callable[[float], float]], Any]
"""(ambient K as a function of time in s) -> a cooler at power-on."""
_TARGET: Final = 263.15
_BAND: Final = 0.1


def _cooled(device: Device | None) -> Cooled:
    return lambda air: Cooler(air, _TARGET)


def windup(cooled: Cooled, hot: float = 1800.0) -> float:
    """Largest undershoot of the chip, K, in the twenty minutes after air of 70 degC for `hot`
    seconds, which saturates the drive. Infinite if the chip does not settle within 0.1 K in ten
    minutes."""
    begin = 600.0
    cooler = cooled(lambda s: 273.15 + (70 if begin <= s < begin + hot else 25))
    run_cooling(cooler, begin + hot)
    after = run_cooling(cooler, 1200.0)
    back = after.settled(_TARGET, _BAND)
    if back is None or back > begin + hot + 600:
        return math.inf
    return float(max(_TARGET - after.chip.min(), 0.0))


CONTROLLING: Final = (
    Case(
        33,
        "light steps of 1e7, adaptive exposure",
        "the exposure stays in 1 us to 2^16 us and is right as soon as the search can have it",
        "longest search by count",
        "shortened without an end",
        "frames late",
        0.0,
        adaptive_steps,
        _adaptive,
    ),
    Case(
        34,
        "no light and swinging light, adaptive exposure",
        "the same after 2000 dark frames and after 300 frames of 0.1 and 1e6 lux in turns",
        "longest search by count",
        "reckoned from the register",
        "frames late",
        0.0,
        adaptive_swings,
        _adaptive,
        {"dark": 100},
    ),
    Case(
        35,
        "light steps of 1e7, mean brightness",
        "the exposure stays in its range and ends where analysis says",
        "closed form",
        "a range forgotten; one leap",
        "ns",
        0.0,
        ebaps_steps,
        _ebaps,
    ),
    Case(
        36,
        "no light and swinging light, mean brightness",
        "the same after 2000 dark frames; no swing moves it further than a step",
        "closed form",
        "a range forgotten; one leap",
        "ns",
        0.0,
        ebaps_swings,
        _ebaps,
    ),
    Case(
        37,
        "sum of a frame of 1280 x 1024",
        "a mean that misses its window by one DN in one pixel is told from one that does not",
        "integers",
        "float32; 32 bits",
        "DN",
        0.0,
        ebaps_sum,
        _sum,
    ),
    Case(
        38,
        "cooler at its end for half an hour",
        "after air of 70 degC the chip is at -10 degC within 0.1 K in ten minutes, and no colder",
        "the target",
        "integral without an end",
        "K",
        0.5,
        windup,
        _cooled,
    ),
)
