"""Control loops as one would first write them: what cases 33 to 38 are there to catch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from imagers.adaptive.device.decision import Search
from imagers.adaptive.device.loop import from_register, unlimited
from imagers.emccd.device.cooling import Cooler


def no_end(search: int) -> Any:
    """Shortens below the shortest exposure, to none."""
    return unlimited(Search(search))


def twice_followed(search: int) -> Any:
    """Reckons from a decision that no frame has shown yet."""
    return from_register(Search(search))


def wound_up(air: Callable[[float], float]) -> Cooler:
    """Integrates while the drive stands at its end."""
    return Cooler(air, 263.15, anti_windup=False)
