"""Steady states and limit cycles of the exposure loop, in closed form, and stress tests of it.

Under steady light the mean is Y(T) = Y0 + b T. The exposures that satisfy the loop are the interval
[T_lo, T_hi] = [(Y_min - Y0)/b, (Y_max - Y0)/b], as long as (Y_max - Y_min)/b. The loop visits T0 +
k s and the ends of its range. It therefore

- rests for certain where the interval is at least a step long: b s <= Y_max - Y_min, which is
  T_lo >= s (Y_min - Y0)/(Y_max - Y_min) = 9.6 ms for Y0 = 0. In terms of the exposure that gives
  the window's middle: 9.92 ms;
- rests by chance where it is shorter: with probability (Y_max - Y_min)/(b s), which is the
  exposure wanted over 9.92 ms, were the light's phase on the grid random;
- hunts otherwise, between the two grid points on either side, for ever;
- stands at an end where even that end is too dark or too bright.

A loop that acts on every frame although it sees each action `latency` frames late passes the first
grid point inside by latency - 1 steps: it needs a window of `latency` steps to rest for certain.

Stress tests of the loop: light that jumps by 1e7, darkness, oscillating light. Each check takes the
loop under test and returns one number, which must be 0 for a correct loop. Means are clipped to the
16 bits of the converter, as in the hardware.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from imagers.ebaps.device.exposure import (
    DEFAULT_EXPOSURE,
    LATENCY,
    ExposureRule,
    Linear,
    follow,
)

Loop = Callable[[ExposureRule, Callable[[int, int], int], int], list[int]]
"""(rule, mean of frame and exposure in DN, frames) -> exposures of the frames, ns."""
Accumulator = Callable[[npt.NDArray[np.uint16]], int]
"""Sum of a frame's values."""
_FULL = 65_535
_ANY_END = 2 * LATENCY + 50 * LATENCY
"""Frames in which a loop that waits crosses its whole range: 50 steps, each seen LATENCY late."""


@dataclass(frozen=True)
class Rest:
    """The exposures at which the controller stays in steady light.

    Attributes:
        kind: "rest" inside the window, "end" at the range's end outside it, "hunt" between two.
        low, high: exposures, ns; the same but for "hunt".
        frames: steps until there.
    """

    kind: Literal["rest", "end", "hunt"]
    low: int
    high: int
    steps: int


def settling_exposure(
    rule: ExposureRule, level: int | Fraction | None = None, steps: int = 1, zero: int = 0
) -> Fraction:
    """Exposure (ns) that gives `level` DN in the brightest light in which the loop is certain to
    settle; the lower limit of the window if None (9.6 ms)."""
    level = rule.low if level is None else level
    return Fraction(steps * rule.step) * (level - zero) / (rule.high - rule.low)


def settle(rule: ExposureRule, light: Linear, start: int = DEFAULT_EXPOSURE) -> Rest:
    """Final state in steady light of a loop with `wait`, without simulation."""
    here = rule.clip(start)
    side = rule.side(light.mean(here), 1)
    if side == 0:
        return Rest("rest", here, here, 0)
    end = rule.longest if side < 0 else rule.shortest
    limit = rule.low if side < 0 else rule.high
    room = abs(end - here)
    steps = math.ceil(room / Fraction(rule.step)) if rule.step else 0
    if light.slope > 0:
        away = abs((limit - light.zero) / light.slope - here)
        steps = min(steps, math.ceil(away / rule.step))
    reached = rule.clip(here - side * steps * rule.step)
    now = rule.side(light.mean(reached), 1)
    if now == 0:
        return Rest("rest", reached, reached, steps)
    if now == side:
        return Rest("end", reached, reached, steps)
    # One step back is the point before, or (from an end of the range) beyond it: on this side.
    back = rule.clip(reached + side * rule.step)
    return Rest("hunt", min(back, reached), max(back, reached), steps)


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
