"""Steady states and limit cycles of the exposure loop, in closed form.

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
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from imagers.ebaps.device.exposure import DEFAULT_EXPOSURE, ExposureRule, Linear

__all__ = [
    "Rest", "last_hunting", "resting", "settle", "settling_exposure", "settling_share", "spans",
]  # fmt: skip


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


def spans(rule: ExposureRule, light: Linear, steps: int = 1) -> bool:
    """Whether the window is at least so many steps wide under this light."""
    return light.slope * rule.step * steps <= rule.high - rule.low


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


def resting(
    rule: ExposureRule, start: int = DEFAULT_EXPOSURE, zero: int = 0
) -> list[tuple[Fraction, Fraction]]:
    """Ideal exposures (middle of the window), ns, for which the loop settles inside the window:
    closed intervals in order, adjacent ones joined."""
    low, high = rule.low - zero, rule.high - zero
    middle = Fraction(low + high, 2)
    start = rule.clip(start)
    points = {start, rule.shortest, rule.longest}
    points |= set(range(start, rule.shortest - 1, -rule.step))
    points |= set(range(start, rule.longest + 1, rule.step))
    merged: list[tuple[Fraction, Fraction]] = []
    for a, b in sorted((p * middle / high, p * middle / low) for p in points):
        if merged and a <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(b, merged[-1][1]))
        else:
            merged.append((a, b))
    return merged


def settling_share(
    rule: ExposureRule, first: int, last: int, start: int = DEFAULT_EXPOSURE
) -> Fraction:
    """Share of the ideal exposures between `first` and `last`, ns, for which the loop settles."""
    inside = Fraction(0)
    for a, b in resting(rule, start):
        inside += max(min(b, Fraction(last)) - max(a, Fraction(first)), Fraction(0))
    return inside / (last - first)


def last_hunting(rule: ExposureRule, start: int = DEFAULT_EXPOSURE) -> Fraction:
    """Upper end, ns, of the last gap: for every longer ideal exposure the loop settles."""
    return resting(rule, start)[-1][0]
