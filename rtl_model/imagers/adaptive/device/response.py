"""Light against output, as document 001 shows it in figure 6(b), and the light that it spans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from rtl_model.imagers.adaptive.device.decision import HALF_SCALE, Search
from rtl_model.imagers.adaptive.device.loop import from_judged, settled, shortest_exposure
from rtl_model.imagers.adaptive.device.registers import DEFAULT_LONGEST
from sensor.imagers.cmos import CmosSetting

__all__ = [
    "Point", "brightest_lux", "combined_response", "darkest_lux", "exponential_deviation",
    "half_scale_lux", "light_range_db", "longest_exposure",
]  # fmt: skip

_SETTING = CmosSetting()


class Point(NamedTuple):
    """Light, lux; the exposure's exponent n of 2^n T and value at which the loop rests; combined:
    value with 128 for every halving of the exposure."""

    lux: float
    exponent: int
    value: int
    combined: int


def longest_exposure(exponent: int = DEFAULT_LONGEST) -> float:
    """Seconds: 2^16 T is 65.536 ms."""
    return (1 << exponent) * shortest_exposure()


def brightest_lux(setting: CmosSetting = _SETTING) -> float:
    """Light that is full scale at the shortest exposure: 1e6 lx."""
    return setting.full_scale / setting.volts(1.0, shortest_exposure())


def darkest_lux(exponent: int = DEFAULT_LONGEST, setting: CmosSetting = _SETTING) -> float:
    """Light that is one DN at the longest exposure: 0.06 lx, within the print's 1e-1."""
    return setting.lsb / setting.volts(1.0, longest_exposure(exponent))


def half_scale_lux(exponent: int = DEFAULT_LONGEST, setting: CmosSetting = _SETTING) -> float:
    """Light that is half scale at the longest exposure; with less, values stay below half."""
    return HALF_SCALE * darkest_lux(exponent, setting)


def light_range_db(exponent: int = DEFAULT_LONGEST, setting: CmosSetting = _SETTING) -> float:
    """20 log10 of the brightest over the darkest light."""
    return 20 * math.log10(brightest_lux(setting) / darkest_lux(exponent, setting))


def combined_response(
    lux: Sequence[float],
    search: Search = Search.HALF,
    longest: int = DEFAULT_LONGEST,
) -> list[Point]:
    """Where the loop rests as light rises through these, each from where it rested before.

    The exposures are powers of two, so the values of many frames are put together to one curve by
    adding half a scale for every halving: between two octaves of light a straight line, over all
    close to an exponential, lux ~ 2^(combined / 128)."""
    rule, points, multiplier = from_judged(search, longest), list[Point](), 1 << longest
    for light in lux:
        rest = settled(light, rule, start=multiplier)
        multiplier = rest.multiplier
        exponent = multiplier.bit_length() - 1
        combined = rest.value + HALF_SCALE * (longest - exponent)
        points.append(Point(light, exponent, rest.value, combined))
    return points


def exponential_deviation(points: Sequence[Point]) -> float:
    """How far light lies from the exponential of the combined output that fits it best, at the most
    and relative; points below half scale are left out. Between octaves light is straight where the
    exponential bends: x 2^-x over 1 <= x <= 2 gives sqrt(2/(e ln 2)) - 1 = 3.0 % either way, and
    whole DN a little more."""
    logs = [math.log2(p.lux) - p.combined / HALF_SCALE for p in points if p.value >= HALF_SCALE]
    return 2.0 ** ((max(logs) - min(logs)) / 2) - 1
