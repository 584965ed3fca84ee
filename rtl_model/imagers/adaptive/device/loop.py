"""The control loop alone: one light a frame, an ideal pixel, decisions two frames deep.

Frame k sees lux[k] and is exposed with what was decided on frame k - 2. For questions of the loop:
how many frames a search takes, what it does under light that jumps, goes out or oscillates.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

from rtl_model.imagers.adaptive.device.decision import (
    HALF_SCALE,
    LONGEST,
    Search,
    decide,
    highest,
    lengthening,
)
from rtl_model.imagers.adaptive.device.registers import DEFAULT_LONGEST
from rtl_model.imagers.adaptive.device.timing import CLOCK_HZ, MINIMUM_CLOCKS
from sensor.imagers.cmos import CmosSetting

__all__ = [
    "Rule", "Seen", "follow", "from_judged", "from_register", "light_for", "recovery",
    "search_path", "settled", "shortest_exposure", "unlimited", "worst_search",
]  # fmt: skip

Rule = Callable[[int, int, int, int | None], int]
"""(multiplier of the frame judged, multiplier register, saturated pixels, largest unsaturated value
or None) to the next multiplier."""
_SETTING = CmosSetting()


class Seen(NamedTuple):
    """One frame: multiple of T, value in DN, whether it is saturated."""

    multiplier: int
    value: int
    saturated: bool


def shortest_exposure(minimum: int = MINIMUM_CLOCKS, clock_hz: int = CLOCK_HZ) -> float:
    """T in seconds: 14H clocks at 20 MHz are 1 us."""
    return minimum / clock_hz


def from_judged(search: Search, longest: int = DEFAULT_LONGEST) -> Rule:
    """As built: reckoned from the exposure that the judged frame had, within the limits."""

    def rule(multiplier: int, register: int, saturated: int, largest: int | None) -> int:
        made = decide(multiplier, saturated, largest, threshold=0, search=search, longest=longest)
        return made.multiplier

    return rule


def from_register(search: Search, longest: int = DEFAULT_LONGEST) -> Rule:
    """Naive: reckoned from the multiplier register, which holds a decision that no frame has shown
    yet; so every change of light is followed twice."""

    def rule(multiplier: int, register: int, saturated: int, largest: int | None) -> int:
        made = decide(register, saturated, largest, threshold=0, search=search, longest=longest)
        return made.multiplier

    return rule


def unlimited(search: Search) -> Rule:
    """Naive: shortens below T, to a multiplier of 0, which no factor brings back."""

    def rule(multiplier: int, register: int, saturated: int, largest: int | None) -> int:
        if saturated:
            if search is Search.ROOT:
                return math.isqrt(multiplier) if multiplier > 1 else 0
            return multiplier >> (8 if search is Search.PART else 1)
        return multiplier * (1 if largest is None else lengthening(largest))

    return rule


def follow(
    lux: Iterable[float],
    rule: Rule,
    *,
    start: int = 1,
    setting: CmosSetting = _SETTING,
    shortest: float | None = None,
) -> list[Seen]:
    """What the loop does under a light of its own in each frame. start: multiplier of the first two
    frames. shortest: T, s."""
    unit = shortest_exposure() if shortest is None else shortest
    ahead, register, seen = [start, start], start, []
    for light in lux:
        multiplier = ahead.pop(0)
        value, saturated = setting.value(light, multiplier * unit)
        seen.append(Seen(multiplier, value, saturated))
        register = rule(multiplier, register, int(saturated), None if saturated else value)
        ahead.append(register)
    return seen


def light_for(multiplier: int, value: float = 192.5, setting: CmosSetting = _SETTING) -> float:
    """Lux that give this value at an exposure of this multiple of T."""
    return value * setting.lsb / setting.volts(1.0, multiplier * shortest_exposure())


def search_path(
    search: Search, start: int = 1 << LONGEST, wanted: int = 1 << 3, longest: int = LONGEST
) -> list[int]:
    """Multipliers from `start` to `wanted`, under light that wants the latter, each the decision on
    a frame that had the one before. Document 001, section 2, counts frames so, one a decision:
    4, 3 and 21 from 2^24 T to 2^3 T. In the pipeline a decision shows two frames on, so by the
    clock it takes twice as many frames (see `follow`)."""
    lux, path = light_for(wanted), [start]
    unit = shortest_exposure()
    while path[-1] != wanted:
        value, saturated = _SETTING.value(lux, path[-1] * unit)
        made = decide(
            path[-1], int(saturated), None if saturated else value,
            threshold=0, search=search, longest=longest,
        )  # fmt: skip
        if made.multiplier == path[-1]:
            raise ValueError(f"{wanted} must be a power of two that the light wants, not kept")
        path.append(made.multiplier)
    return path


def settled(lux: float, rule: Rule, *, start: int = 1, frames: int = 60) -> Seen:
    """Where the loop comes to rest under steady light. RuntimeError where it does not."""
    last = follow([lux] * frames, rule, start=start)[-4:]
    if any(each != last[-1] for each in last):
        raise RuntimeError(f"the loop does not come to rest at {lux:g} lx: {last}")
    return last[-1]


def worst_search(search: Search, longest: int = DEFAULT_LONGEST) -> int:
    """Most decisions that any power of two takes to any other under light that wants the other."""
    return max(
        len(search_path(search, 1 << a, 1 << b, longest)) - 1
        for a in range(longest + 1)
        for b in range(longest + 1)
    )


def recovery(
    lux: list[float], change: int, rule: Rule, *, start: int = 1, longest: int = DEFAULT_LONGEST
) -> int:
    """Frames from the first that sees the light's last change (number `change`) to the last that is
    not as it should be: half scale to full, or dark with the longest exposure, or saturated with
    the shortest. The length of `lux` less `change` where it never is."""
    seen = follow(lux, rule, start=start)
    bad = [n for n, each in enumerate(seen) if n >= change and not _as_it_should(each, longest)]
    return bad[-1] + 1 - change if bad else 0


def _as_it_should(seen: Seen, longest: int) -> bool:
    if seen.saturated:
        return seen.multiplier == 1
    if seen.value >= HALF_SCALE:
        return highest(seen.multiplier) == seen.multiplier
    return seen.multiplier == 1 << longest
