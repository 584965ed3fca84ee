"""Cases 33 to 38: the control loops of the other imagers under light that steps by 1e7, is none, or
swings, and a cooler that cannot reach its target for half an hour."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from cosim.compute.opencl import Device
from cosim.run.case import Case
from rtl_model.imagers.adaptive.device.decision import Search
from rtl_model.imagers.adaptive.device.loop import follow, from_judged, recovery, worst_search
from rtl_model.imagers.ebaps.device.extremes import (
    accumulated,
    dark_then_light,
    light_steps,
    shipped_loop,
    swinging,
)
from rtl_model.imagers.emccd.device.cooling import Cooler, run_cooling

__all__ = ["CONTROLLING"]

Adaptive = Callable[[int], Any]
"""Number of a search, 1 to 3 -> the rule of the exposure selection, see `adaptive.Rule`."""
_EXPONENT: Final = 16
"""Of the adaptive sensor's longest exposure, 2^16 us."""


def _adaptive(device: Device | None) -> Adaptive:
    return lambda search: from_judged(Search(search), _EXPONENT)


def _late(rule_of: Adaptive, courses: list[tuple[list[float], int]]) -> float:
    """Most frames by which the loop is later than its search may be: two frames for each decision,
    and the two that were exposed before. Infinite where an exposure leaves 1 us to 2^16 us."""
    worst = 0.0
    for search in Search:
        rule, most = rule_of(int(search)), 2 * worst_search(search, _EXPONENT) + 2
        for lux, change in courses:
            for start in (1, 1 << _EXPONENT):
                seen = follow(lux, rule, start=start)
                if not all(1 <= each.multiplier <= 1 << _EXPONENT for each in seen):
                    return math.inf
                worst = max(worst, recovery(lux, change, rule, start=start) - most)
    return worst


# 33 ------------------------------------------------------------------------------------------


def _steps() -> list[tuple[list[float], int]]:
    """Up and down by 1e7, over the whole range of the sensor's light, and beyond it."""
    pairs = [(0.1, 1e6), (1e6, 0.1), (3.0, 3e7), (3e7, 3.0), (1e-3, 1e4), (1e4, 1e-3)]
    return [([before] * 60 + [after] * 80, 60) for before, after in pairs]


def adaptive_steps(rule_of: Adaptive) -> float:
    """See `_late`."""
    return _late(rule_of, _steps())


# 34 ------------------------------------------------------------------------------------------


def _none_and_swings(dark: int) -> list[tuple[list[float], int]]:
    """So many frames without light, then some; light of 1e-1 and 1e6 lux in turns of 1 to 9 frames,
    and in turns that grow, then one light."""
    made = [([0.0] * dark + [after] * 80, dark) for after in (0.1, 30.0, 1e6, 1e9)]
    for turn in range(1, 10):
        swing = [(0.1, 1e6)[n // turn % 2] for n in range(300)]
        made += [([*swing, *([after] * 80)], 300) for after in (1.0, 1e3)]
    growing = [1e6 if n % 2 else 0.1 for n in range(40) for _ in range(n + 1)]
    return [*made, ([*growing, *([50.0] * 80)], len(growing))]


def adaptive_swings(rule_of: Adaptive, dark: int = 2000) -> float:
    """See `_late`."""
    return _late(rule_of, _none_and_swings(dark))


# 35, 36, 37 ----------------------------------------------------------------------------------


def _ebaps(device: Device | None) -> Any:
    return shipped_loop


def ebaps_steps(loop: Any) -> float:
    """ns off the range, or off where analysis says the loop ends between steps of 1e7."""
    return float(light_steps(loop))


def ebaps_swings(loop: Any) -> float:
    """ns off the range or off where the loop must end after 2000 dark frames, or by which light
    that swings moved an exposure further than a step."""
    return float(max(dark_then_light(loop), swinging(loop)))


def _sum(device: Device | None) -> Any:
    """The sum that the loop is given of a frame."""
    return lambda frame: int(frame.sum(dtype=np.int64))


def ebaps_sum(total: Any) -> float:
    """DN by which the sum of a whole frame is wrong: one is a wrong decision."""
    return float(accumulated(total))


# 38 ------------------------------------------------------------------------------------------

Cooled = Callable[[Callable[[float], float]], Any]
"""Air's kelvin by seconds -> a cooler that has just been switched on."""
_TARGET: Final = 263.15
_BAND: Final = 0.1


def _cooled(device: Device | None) -> Cooled:
    return lambda air: Cooler(air, _TARGET)


def windup(cooled: Cooled, hot: float = 1800.0) -> float:
    """Kelvin by which the chip falls below its target in twenty minutes after air of 70 degC, in
    which the drive stood at its end; infinite where it is not within 0.1 K again in ten."""
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
