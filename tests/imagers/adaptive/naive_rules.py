"""Naive rules of the exposure search, which extremes of light break."""

from __future__ import annotations

import math

from imagers.adaptive.device.decision import Search, decide, lengthening
from imagers.adaptive.device.loop import Rule
from imagers.adaptive.device.registers import DEFAULT_LONGEST


def from_register(search: Search, longest: int = DEFAULT_LONGEST) -> Rule:
    """The decision starts from the multiplier register. The register holds a decision
    that no frame shows yet, so the loop follows every change of light twice."""

    def rule(multiplier: int, register: int, saturated: int, largest: int | None) -> int:
        return decide(
            register, saturated, largest, threshold=0, search=search, longest=longest
        ).multiplier

    return rule


def unlimited(search: Search) -> Rule:
    """It shortens below T, to a multiplier of 0, from which no factor recovers."""

    def rule(multiplier: int, register: int, saturated: int, largest: int | None) -> int:
        if saturated:
            if search is Search.ROOT:
                return math.isqrt(multiplier) if multiplier > 1 else 0
            return multiplier >> (8 if search is Search.PART else 1)
        return multiplier * (1 if largest is None else lengthening(largest))

    return rule
