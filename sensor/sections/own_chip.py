"""The chip of a [sensor] section: a preset, with the user's own numbers in their places."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

from cosim.config.amounts import at_most
from cosim.errors import InputError
from sensor.device.chips import CHIPS, MOST_PIXELS, Chip

_NUMBERS: Final = ("width", "height", "pitch", "fill_factor", "quantum_efficiency")
_ROUNDING: Final = 1e-9


def own_chip(section: Any) -> Chip:
    """The preset of a section with the section's own numbers in their places."""
    return CHIPS[section.chip].own(**{name: getattr(section, name) for name in _NUMBERS})


def row_skew(section: Any) -> float:
    """Share of a cycle in which the rows are sampled, by `row_time` if the section has it."""
    if section.row_time is None:
        return float(section.row_skew)
    return min(float(section.row_time * own_chip(section).height * section.clock), 1.0)


def check_chip(section: Any) -> None:
    """Raises InputError for an array that is too large, rows that take longer than a cycle, and
    keys that contradict each other."""
    chip = own_chip(section)
    for name in ("asynchronous", "continuous"):
        array = getattr(section, name)
        for side in ("width", "height"):
            size = None if array is None else getattr(array, side)
            if size is None:
                continue
            if getattr(section, side) not in (None, size):
                raise InputError(
                    f"sensor.{side}", f"absent with sensor.{name}.{side} = {size}, or as large",
                    f"{getattr(section, side)}", "leave one of the two out",
                )  # fmt: skip
            chip = replace(chip, **{side: size})
    if chip.width * chip.height > MOST_PIXELS:
        raise InputError(
            "sensor.width x sensor.height", f"at most {MOST_PIXELS:,} pixels",
            f"{chip.width} x {chip.height} = {chip.width * chip.height:,}", "lower one",
        )  # fmt: skip
    if section.row_time is not None:
        _check_rows(section, chip)
    if section.clock_steering and chip.steering is None:
        able = ", ".join(name for name, each in CHIPS.items() if each.steering is not None)
        raise InputError(
            "sensor.clock_steering", f"true only for a chip whose board can steer it ({able})",
            f"true for {section.chip}", "leave it out",
        )  # fmt: skip


def _check_rows(section: Any, chip: Chip) -> None:
    if section.pixel != "latched":
        raise InputError(
            "sensor.row_time", "given with sensor.pixel = latched",
            f"with {section.pixel}", "leave it out: no rows are sampled",
        )  # fmt: skip
    frame = section.row_time * chip.height
    skew = frame * section.clock
    if skew > 1 + _ROUNDING:
        raise InputError(
            "sensor.clock",
            f"at most {at_most(1 / frame)} Hz for {chip.height} rows of "
            f"{section.row_time * 1e9:g} ns to fit in a cycle",
            f"{section.clock:g} Hz", "lower it, or sensor.row_time",
        )  # fmt: skip
    if section.row_skew and not math.isclose(section.row_skew, skew, rel_tol=_ROUNDING):
        raise InputError(
            "sensor.row_skew", f"absent with sensor.row_time, which states {skew:g}",
            f"{section.row_skew:g}", "leave one of the two out",
        )  # fmt: skip
