"""The asynchronous camera that a scenario asks for: its pixels and its channel."""

from __future__ import annotations

from cosim import PS, Clock, InputError, seconds_to_ps
from scenarios.assemble.camera import camera_setting, resized
from scenarios.assemble.readout import refuse_keys, with_section
from scenarios.assemble.scenario import Scenario
from sensor import CameraSetting
from sensor.asynchronous import EventModel, EventPixels, EventPlan, PlannedPixels
from sensor.asynchronous.channel import ChannelModel
from sensor.sections.asynchronous import AsynchronousSection

__all__ = ["channel_model", "event_model", "event_pixels", "event_setting", "with_defaults"]


def with_defaults(scenario: Scenario) -> Scenario:
    """The scenario with [sensor.asynchronous] written out."""
    return with_section(scenario, "asynchronous", AsynchronousSection())


def _section(scenario: Scenario) -> AsynchronousSection:
    return scenario.sensor.asynchronous or AsynchronousSection()


def event_setting(scenario: Scenario) -> CameraSetting:
    """Chip, light and device as for any camera; the array as large as the scenario says."""
    sensor, section = scenario.sensor, _section(scenario)
    refuse_keys(
        "asynchronous",
        (
            ("reset", sensor.reset, "residual"),
            ("threshold_noise", sensor.threshold_noise, 0),
            ("capacitance", sensor.capacitance, None),
            ("row_skew", sensor.row_skew, 0),
        ),
        "leave it out: these pixels fire at their threshold and start from nothing",
    )
    return resized(camera_setting(scenario), section.width, section.height)


def _threshold(scenario: Scenario, setting: CameraSetting) -> int:
    """Whole electrons at the level chosen; raises InputError for a part of one."""
    sensor, chosen = scenario.sensor, setting.threshold
    if chosen == round(chosen):
        return round(chosen)
    what, mend = "sensor.threshold", f"write {round(chosen)} e"
    levels = setting.chip.threshold_levels
    if sensor.threshold_level != levels:
        what += f" at level {sensor.threshold_level} of {levels}"
        mend = f"choose a sensor.threshold_level that parts {sensor.threshold:g} e evenly"
    raise InputError(what, "whole electrons with readout = asynchronous", f"{chosen:g} e", mend)


def event_model(scenario: Scenario, setting: CameraSetting) -> EventModel:
    """The pixel's rules; raises InputError for what they cannot be. setting: of `event_setting`,
    whose threshold is that of the level chosen."""
    sensor, section = scenario.sensor, _section(scenario)
    key = "sensor.asynchronous"
    threshold = _threshold(scenario, setting)
    clock = Clock.from_hz(section.timing)
    if PS * clock.den % clock.num:
        raise InputError(
            f"{key}.timing", "a clock of whole picoseconds a period, such as 1 GHz or 800 MHz",
            f"{section.timing:g} Hz", "choose one",
        )  # fmt: skip
    tick = PS * clock.den // clock.num
    shortest = seconds_to_ps(section.shortest_width)
    if shortest < tick:
        raise InputError(
            f"{key}.shortest_width", f"at least a period of the timing clock, {tick} ps",
            f"{shortest} ps", "lengthen it or raise timing",
        )  # fmt: skip
    longest = 0 if section.longest_width is None else seconds_to_ps(section.longest_width)
    if longest and longest < shortest:
        raise InputError(
            f"{key}.longest_width", f"at least the shortest, {section.shortest_width:g} s",
            f"{section.longest_width:g} s", "lengthen it",
        )  # fmt: skip
    if section.levels > 1 and not longest:
        raise InputError(
            f"{key}.levels", "given with longest_width", "alone", f"add {key}.longest_width"
        )
    if section.levels > threshold:
        raise InputError(
            f"{key}.levels", f"at most one an electron, {threshold}",
            f"{section.levels}", "lower it",
        )  # fmt: skip
    return EventModel(
        threshold,
        scenario.seed,
        clock,
        shortest,
        longest,
        section.levels,
        seconds_to_ps(sensor.comparator_delay),
        seconds_to_ps(sensor.dead_time),
        section.change,
    )


def event_pixels(scenario: Scenario, setting: CameraSetting, plan: EventPlan) -> EventPixels:
    """The pixels of the scenario's kind, run by a plan."""
    return PlannedPixels(
        plan,
        setting.pattern,
        (setting.chip.height, setting.chip.width),
        setting.electrons_per_lux,
        most=_section(scenario).most_events,
    )


def channel_model(scenario: Scenario) -> ChannelModel | None:
    """The shared output, None where every event leaves as it fires."""
    section = scenario.sensor.channel
    if section is None:
        return None
    if section.buffer == "fifo" and section.arbitration != "fifo":
        raise InputError(
            "sensor.channel.arbitration", "fifo with buffer = fifo: a queue is served in order",
            section.arbitration, "change one of them",
        )  # fmt: skip
    return ChannelModel(
        max(1, round(PS / section.rate)), section.arbitration, section.buffer, section.depth
    )
