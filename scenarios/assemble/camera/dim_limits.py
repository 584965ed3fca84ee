"""Limits of dim light in a scenario: time between readings, and width of a dark interval."""

from __future__ import annotations

import math
from typing import Final

from cosim import InputError
from cosim.config.amounts import amount
from sensor import CameraSetting
from sensor.dynamic_range import longest_width
from sensor.sections.sensor import SensorSection

_MOST: Final = 2**31
"""Readings of single pixels that a run may take; they are kept in memory, two bytes each."""
_KEY: Final = "sensor.sub_threshold.limit"


def check_dim(section: SensorSection, setting: CameraSetting, cycles: int) -> None:
    """Raises InputError for readings or a dark limit that a run of so many cycles cannot have."""
    dark_cycles(section, setting)
    if section.sub_threshold is None:
        return
    every, hertz = cycles_between(section, setting), setting.clock.hz
    if not 1 <= every <= cycles:
        least, most = amount(1 / hertz, "s"), amount(cycles / hertz, "s")
        raise InputError(
            _KEY, f"{least} to {most}, one cycle to the run",
            repr(amount(section.sub_threshold.limit, "s")),
            "shorten it, or lengthen duration" if every else "lengthen it, or raise sensor.clock",
        )  # fmt: skip
    readings, pixels = cycles // every + 1, setting.chip.height * setting.chip.width
    if readings * pixels > _MOST:
        raise InputError(
            _KEY, f"so long that {_MOST // pixels} readings are enough", f"{readings} readings",
            "lengthen it, or shorten duration",
        )  # fmt: skip


def cycles_between(section: SensorSection, setting: CameraSetting) -> int:
    """Cycles between two readings."""
    assert section.sub_threshold is not None
    return round(section.sub_threshold.limit * setting.clock.hz)


def dark_cycles(section: SensorSection, setting: CameraSetting) -> float:
    """Width in cycles from which on an interval is rejected; infinite for none. Raises InputError
    if the device whose dark current decides has none."""
    if section.dark_limit is None:
        return math.inf
    seconds = section.dark_limit
    if not seconds:
        dark = 0.0 if setting.pattern is None else setting.pattern.dark
        if not dark:
            raise InputError(
                "sensor.pattern.dark_current", "above 0 with sensor.dark_limit = 'dark current'",
                "0 e/s", "give it, or a duration as sensor.dark_limit",
            )  # fmt: skip
        seconds = longest_width(setting.threshold, dark)
    return seconds * setting.clock.hz
