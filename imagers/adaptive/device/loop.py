"""The control loop alone: one illuminance per frame, an ideal pixel, and a delay of two frames; and
its output against light, as in figure 6(b) of document 001, with the range of light.

Frame k has illuminance lux[k] and the exposure decided on frame k - 2. This model answers how many
frames a search takes, and how the loop responds to light that steps, goes out or oscillates.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from imagers.adaptive.device.decision import HALF_SCALE, LONGEST, Search, decide, highest
from imagers.adaptive.device.registers import DEFAULT_LONGEST
from imagers.adaptive.device.timing import CLOCK_HZ, MINIMUM_CLOCKS
from imagers.adaptive.pixels import CmosSetting

Rule = Callable[[int, int, int, int | None], int]
"""(multiplier of the judged frame, multiplier register, number of saturated pixels, largest
unsaturated value or None) -> next multiplier."""
_SETTING = CmosSetting()


class LoopFrame(NamedTuple):
    """One frame of the loop.

    Attributes:
        multiplier: exposure, in units of T.
        value: pixel value, DN.
        saturated: whether the pixel is saturated.
    """

    multiplier: int
    value: int
    saturated: bool


def shortest_exposure(minimum: int = MINIMUM_CLOCKS, clock_hz: int = CLOCK_HZ) -> float:
    """The shortest exposure T, s: 14H clocks at 20 MHz are 1 us."""
    return minimum / clock_hz


def from_judged(search: Search, longest: int = DEFAULT_LONGEST) -> Rule:
    """The rule as built: the decision starts from the exposure of the judged frame."""

    def rule(multiplier: int, register: int, saturated: int, largest: int | None) -> int:
        return decide(
            multiplier, saturated, largest, threshold=0, search=search, longest=longest
        ).multiplier

    return rule


def follow(
    lux: Iterable[float],
    rule: Rule,
    *,
    start: int = 1,
    setting: CmosSetting = _SETTING,
    shortest: float | None = None,
) -> list[LoopFrame]:
    """Simulates the loop.

    Args:
        lux: illuminance of each frame.
        rule: decision rule.
        start: multiplier of the first two frames.
        setting: setting of the pixel.
        shortest: T, s; None for `shortest_exposure()`.
    """
    unit = shortest_exposure() if shortest is None else shortest
    ahead, register, frames = [start, start], start, []
    for light in lux:
        multiplier = ahead.pop(0)
        value, saturated = setting.value(light, multiplier * unit)
        frames.append(LoopFrame(multiplier, value, saturated))
        register = rule(multiplier, register, int(saturated), None if saturated else value)
        ahead.append(register)
    return frames


def light_for(multiplier: int, value: float = 192.5, setting: CmosSetting = _SETTING) -> float:
    """Illuminance, lux, that gives a value (DN) at an exposure of `multiplier` T."""
    return value * setting.lsb / setting.volts(1.0, multiplier * shortest_exposure())


def search_path(
    search: Search, start: int = 1 << LONGEST, wanted: int = 1 << 3, longest: int = LONGEST
) -> list[int]:
    """Multipliers of a search from `start` to `wanted`, under light that requires the latter.

    Each multiplier is the decision on a frame with the one before. Document 001, section 2, counts
    one frame per decision: 4, 3 and 21 frames from 2^24 T to 2^3 T. In the sensor a decision takes
    effect two frames later, so the search takes twice as many frames (see `follow`).
    """
    lux, path = light_for(wanted), [start]
    unit = shortest_exposure()
    while path[-1] != wanted:
        value, saturated = _SETTING.value(lux, path[-1] * unit)
        decision = decide(
            path[-1], int(saturated), None if saturated else value,
            threshold=0, search=search, longest=longest,
        )  # fmt: skip
        if decision.multiplier == path[-1]:
            raise ValueError(f"{wanted} must be a power of two that the search reaches")
        path.append(decision.multiplier)
    return path


def settled(lux: float, rule: Rule, *, start: int = 1, frames: int = 60) -> LoopFrame:
    """The state in which the loop settles under constant light. Raises RuntimeError if it does
    not settle."""
    last = follow([lux] * frames, rule, start=start)[-4:]
    if any(each != last[-1] for each in last):
        raise RuntimeError(f"the loop does not come to rest at {lux:g} lx: {last}")
    return last[-1]


def worst_search(search: Search, longest: int = DEFAULT_LONGEST) -> int:
    """Largest number of decisions from any power of two to any other."""
    return max(
        len(search_path(search, 1 << a, 1 << b, longest)) - 1
        for a in range(longest + 1)
        for b in range(longest + 1)
    )


def recovery(
    lux: list[float], change: int, rule: Rule, *, start: int = 1, longest: int = DEFAULT_LONGEST
) -> int:
    """Frames from the last change of the light to the last frame with a wrong exposure.

    A right exposure gives a value from half to full scale, or is the longest one in the dark, or
    the shortest one under saturating light.

    Args:
        lux: illuminance of each frame.
        change: number of the first frame after the last change.
        rule: decision rule.
        start: multiplier of the first two frames.
        longest: exponent of the longest exposure.
    """
    frames = follow(lux, rule, start=start)
    bad = [n for n, each in enumerate(frames) if n >= change and not _is_right(each, longest)]
    return bad[-1] + 1 - change if bad else 0


def _is_right(frame: LoopFrame, longest: int) -> bool:
    if frame.saturated:
        return frame.multiplier == 1
    if frame.value >= HALF_SCALE:
        return highest(frame.multiplier) == frame.multiplier
    return frame.multiplier == 1 << longest


class Point(NamedTuple):
    """The settled loop at one illuminance.

    Attributes:
        lux: illuminance.
        exponent: n of the exposure 2^n T.
        value: DN.
        combined: value plus 128 DN for every halving of the longest exposure.
    """

    lux: float
    exponent: int
    value: int
    combined: int


def longest_exposure(exponent: int = DEFAULT_LONGEST) -> float:
    """The exposure 2^n T, s: 2^16 T is 65.536 ms."""
    return (1 << exponent) * shortest_exposure()


def brightest_lux(setting: CmosSetting = _SETTING) -> float:
    """Illuminance of full scale at the shortest exposure: 1e6 lx."""
    return setting.full_scale / setting.volts(1.0, shortest_exposure())


def darkest_lux(exponent: int = DEFAULT_LONGEST, setting: CmosSetting = _SETTING) -> float:
    """Illuminance of one DN at the longest exposure: 0.06 lx; the document states 1e-1 lx."""
    return setting.lsb / setting.volts(1.0, longest_exposure(exponent))


def combined_response(
    lux: Sequence[float],
    search: Search = Search.HALF,
    longest: int = DEFAULT_LONGEST,
) -> list[Point]:
    """The settled loop at increasing illuminances, each started from the state before.

    The exposures are powers of two. Half a scale is added for every halving, which joins the values
    of many frames to one curve: linear within an octave of light, and close to an exponential
    overall, lux ~ 2^(combined / 128).
    """
    rule, points, multiplier = from_judged(search, longest), list[Point](), 1 << longest
    for light in lux:
        rest = settled(light, rule, start=multiplier)
        multiplier = rest.multiplier
        exponent = multiplier.bit_length() - 1
        combined = rest.value + HALF_SCALE * (longest - exponent)
        points.append(Point(light, exponent, rest.value, combined))
    return points


def exponential_deviation(points: Sequence[Point]) -> float:
    """Largest relative deviation of the illuminance from the best exponential of the combined
    output, for points at half scale and above.

    Within an octave the response is linear, not exponential: x 2^-x over 1 <= x <= 2 gives
    sqrt(2/(e ln 2)) - 1 = 3.0 % either way. Rounding to whole DN adds a little.
    """
    logs = [math.log2(p.lux) - p.combined / HALF_SCALE for p in points if p.value >= HALF_SCALE]
    return 2.0 ** ((max(logs) - min(logs)) / 2) - 1
