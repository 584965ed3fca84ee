"""Stress tests of the exposure loop: light that jumps by 1e7, darkness, oscillating light.

Each check takes the loop under test and returns one number, which must be 0 for a correct loop.
Means are clipped to the 16 bits of the converter, as in the hardware.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from imagers.ebaps.device.exposure import (
    DEFAULT_EXPOSURE,
    LATENCY,
    ExposureRule,
    Linear,
    follow,
)
from imagers.ebaps.device.settling import settle

__all__ = ["Loop", "accumulated", "dark_then_light", "light_steps", "shipped_loop", "swinging"]

Loop = Callable[[ExposureRule, Callable[[int, int], int], int], list[int]]
"""(rule, mean of frame and exposure in DN, frames) -> exposures of the frames, ns."""
Accumulator = Callable[[npt.NDArray[np.uint16]], int]
"""Sum of a frame's values."""

_FULL = 65_535
_ANY_END = 2 * LATENCY + 50 * LATENCY
"""Frames in which a loop that waits crosses its whole range: 50 steps, each seen LATENCY late."""


def shipped_loop(
    rule: ExposureRule, brightness: Callable[[int, int], int], frames: int
) -> list[int]:
    """The loop of this package."""
    return follow(rule, brightness, frames)


def _mean(light: float, exposure: int) -> int:
    """DN of light that gives 24 800 DN in `DEFAULT_EXPOSURE` where it is 1."""
    return min(int(24_800 * light * exposure / DEFAULT_EXPOSURE), _FULL) if exposure > 0 else 0


def _outside(rule: ExposureRule, exposures: list[int]) -> int:
    """Worst distance of an exposure from its range, ns."""
    return max(max(rule.shortest - e, e - rule.longest, 0) for e in exposures)


def light_steps(loop: Loop, factor: float = 1e7, turns: int = 4) -> float:
    """Light jumps by `factor` up and down around the light of the default exposure. Returns the
    largest deviation, ns, from the range or from the closed form of the final exposure before each
    jump."""
    rule = ExposureRule()
    levels = [factor**0.5, factor**-0.5]

    def brightness(frame: int, exposure: int) -> int:
        return _mean(levels[frame // _ANY_END % 2], exposure)

    exposures = loop(rule, brightness, turns * _ANY_END)
    worst = _outside(rule, exposures)
    for turn in range(turns):
        end = rule.shortest if turn % 2 == 0 else rule.longest
        worst = max(worst, abs(exposures[(turn + 1) * _ANY_END - 1] - end))
    return float(worst)


def dark_then_light(loop: Loop, dark: int = 2000) -> float:
    """A number of frames in darkness, then light for an exposure of 20 ms. Returns the largest
    deviation, ns, from the range, or from the closed form of the final exposure after the time that
    the loop needs to cross the range."""
    rule = ExposureRule()
    wanted = 20_000_000

    def brightness(frame: int, exposure: int) -> int:
        return 0 if frame < dark else _mean(DEFAULT_EXPOSURE / wanted, exposure)

    exposures = loop(rule, brightness, dark + _ANY_END)
    rest = settle(rule, Linear.wanting(wanted, rule), rule.longest)
    assert rest.kind == "rest"
    return float(max(_outside(rule, exposures), abs(exposures[-1] - rest.low)))


def swinging(loop: Loop, factor: float = 1e7, frames: int = 2000) -> float:
    """Light alternates between two levels every 1, 2, 4, ... 256 frames. Returns the largest
    deviation, ns, from the range, or by which an exposure changed more than one step between two
    frames."""
    rule = ExposureRule()
    runs = np.repeat(np.arange(9), 2 ** np.arange(9))

    def brightness(frame: int, exposure: int) -> int:
        bright = runs[frame % runs.size] % 2 == 0
        return _mean(factor**0.5 if bright else factor**-0.5, exposure)

    exposures = loop(rule, brightness, frames)
    moved = max(abs(b - a) for a, b in pairwise(exposures))
    return float(max(_outside(rule, exposures), moved - rule.step, 0))


def accumulated(total: Accumulator, pixels: int = 1280 * 1024) -> float:
    """Frames that miss the window by 1 DN in one pixel, and a frame at full scale. Returns the
    largest error of the sum, DN; a decision can be wrong from 1 DN."""
    worst = 0
    for level, last in ((24_000, 23_999), (25_600, 25_601), (_FULL, _FULL)):
        frame = np.full(pixels, level, np.uint16)
        frame[-1] = last
        worst = max(worst, abs(int(total(frame)) - (level * (pixels - 1) + last)))
    return float(worst)
