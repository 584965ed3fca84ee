"""Output against light, as in figure 6(b) of document 001, and the range of light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from imagers.adaptive.device.decision import HALF_SCALE, Search
from imagers.adaptive.device.loop import from_judged, settled, shortest_exposure
from imagers.adaptive.device.registers import DEFAULT_LONGEST
from imagers.adaptive.pixels import CmosSetting

__all__ = [
    "Point", "brightest_lux", "combined_response", "darkest_lux", "exponential_deviation",
    "half_scale_lux", "longest_exposure",
]  # fmt: skip

_SETTING = CmosSetting()


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


def half_scale_lux(exponent: int = DEFAULT_LONGEST, setting: CmosSetting = _SETTING) -> float:
    """Illuminance of half scale at the longest exposure; below it, values stay below half."""
    return HALF_SCALE * darkest_lux(exponent, setting)


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
