"""The chip of a [sensor] section: a preset, with the user's own numbers in their places, and the
entries [[sensor.writes]], writes to its registers while it runs.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, Final

from pydantic import Field

from cosim.clock import Clock, seconds_to_ps
from cosim.config.amounts import at_most
from cosim.config.quantity import Frequency, Section, Time
from cosim.errors import InputError
from sensor.device.chips import CHIPS, MOST_PIXELS, Chip
from sensor.latched.writes import Write

_NUMBERS: Final = ("width", "height", "pitch", "fill_factor", "quantum_efficiency")
_ROUNDING: Final = 1e-9
LEVELS: Final = 16
"""Threshold settings from outside (Huang 2022 section 6), on either chip."""
_MOST: Final = 1000


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


class WriteSection(Section):
    """One write to the registers of the chip in mid-run."""

    at: Time | None = Field(
        default=None, examples=["10 ms"], description="holds from the first cycle that begins then"
    )
    cycle: Annotated[int, Field(ge=0)] | None = Field(
        default=None, examples=[400], description="holds from this cycle on; in place of at"
    )
    threshold_level: Annotated[int, Field(ge=1, le=LEVELS)] | None = Field(
        default=None, examples=[8], description="level from then on, also for running intervals"
    )
    window: tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]] | None = Field(
        default=None,
        examples=["[100, 200]"],
        description="rows [first, stop) that are read from then on; the others are held in reset",
    )
    clock: Frequency | None = Field(
        default=None, examples=["20 kHz"], description="refused: a run has one clock"
    )


Writes = Annotated[tuple[WriteSection, ...], Field(max_length=_MOST)]


def _cycle(write: WriteSection, clock: Clock) -> int:
    """First cycle for which a write holds."""
    if write.cycle is not None:
        return write.cycle
    assert write.at is not None
    ps = seconds_to_ps(write.at)
    cycle = clock.cycle_at(ps)
    return cycle if clock.edge(cycle) == ps else cycle + 1


def check_writes(section: Any) -> None:
    """Raises InputError for writes that no chip has, or that a run cannot make."""
    if not section.writes:
        return
    height = own_chip(section).height
    for n, write in enumerate(section.writes):
        key = f"sensor.writes[{n}]"
        if (write.at is None) == (write.cycle is None):
            given = "neither" if write.at is None else "both"
            raise InputError(key, "given with at or with cycle", given, "give one of the two")
        if write.clock is not None:
            raise InputError(
                f"{key}.clock", "absent: cycles are numbered by one clock, in the stream's files, "
                "the images and the display alike", f"{write.clock:g} Hz",
                "record two runs, or set sensor.clock",
            )  # fmt: skip
        if write.threshold_level is None and write.window is None:
            raise InputError(key, "one of threshold_level and window", "neither", "give one")
        if write.window is not None and not 0 <= write.window[0] < write.window[1] <= height:
            raise InputError(
                f"{key}.window", f"rows [first, stop) within 0 to {height}",
                str(list(write.window)), f"write [0, {height}] for all rows, or a part of them",
            )  # fmt: skip
    for name in ("circuit", "sub_threshold", "dark_limit"):
        if getattr(section, name) is not None:
            raise InputError(
                f"sensor.{name}", "absent with sensor.writes: it knows one threshold", "given",
                "leave one of the two out",
            )  # fmt: skip
    if section.pixel != "latched":
        raise InputError(
            "sensor.writes", "empty unless sensor.pixel = latched", section.pixel,
            "leave them out: these pixels have no latch to write between",
        )  # fmt: skip
    cycles = [_cycle(write, Clock.from_hz(section.clock)) for write in section.writes]
    for n in range(1, len(cycles)):
        if cycles[n] <= cycles[n - 1]:
            raise InputError(
                f"sensor.writes[{n}]", f"after cycle {cycles[n - 1]}, that of the write before",
                f"at cycle {cycles[n]}", "order them, and join those of one cycle",
            )  # fmt: skip


def register_writes(section: Any, clock: Clock) -> tuple[Write, ...]:
    """The writes of a section."""
    return tuple(
        Write(
            _cycle(write, clock),
            None if write.threshold_level is None
            else section.threshold * write.threshold_level / LEVELS,
            write.window,
        )
        for write in section.writes or ()
    )  # fmt: skip


def write_rows(section: Any, clock: Clock) -> list[list[str]]:
    """A row of a report's table for each write."""
    rows = []
    for write in section.writes or ():
        parts = []
        if write.threshold_level is not None:
            charge = section.threshold * write.threshold_level / LEVELS
            parts.append(f"threshold level {write.threshold_level} of {LEVELS}, {charge:g} e")
        if write.window is not None:
            parts.append(f"rows {write.window[0]} to {write.window[1] - 1} read")
        rows.append([f"register write at cycle {_cycle(write, clock)}", ", ".join(parts),
                     "scenario"])  # fmt: skip
    return rows
