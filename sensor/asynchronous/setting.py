"""The pixels and the channel of a [sensor] section."""

from __future__ import annotations

from cosim import PS, Clock, InputError, seconds_to_ps
from cosim.config.amounts import at_least
from cosim.config.quantity import DAY
from sensor.asynchronous.core import EventCamera, Sending
from sensor.asynchronous.model import EventModel
from sensor.asynchronous.readout.channel import ChannelModel
from sensor.latched.setting import CameraSetting
from sensor.sections.sensor import SensorSection
from sensor.sections.unlatched import AsynchronousSection


def event_camera(sensor: SensorSection, setting: CameraSetting, tolerance: float) -> EventCamera:
    """The camera, ready to be called. setting, and raises: see `event_model`."""
    section, channel = sensor.asynchronous or AsynchronousSection(), sensor.channel
    late = channel is not None and channel.timestamp == "channel"
    sending = Sending(channel_model(sensor), late, section.most_events)
    return EventCamera(setting, event_model(sensor, setting), sending, tolerance=tolerance)


def event_model(sensor: SensorSection, setting: CameraSetting) -> EventModel:
    """The rules of a pixel. setting: with the threshold of the level chosen.

    Raises InputError for values that do not go together.
    """
    section = sensor.asynchronous or AsynchronousSection()
    key = "sensor.asynchronous"
    threshold = _threshold(sensor, setting)
    clock = Clock.from_hz(section.timing)
    if PS * clock.den % clock.num:
        raise InputError(
            f"{key}.timing", "a clock of whole picoseconds a period, such as 1 GHz or 800 MHz",
            f"{section.timing:g} Hz", "choose one",
        )  # fmt: skip
    tick = PS * clock.den // clock.num
    if tick > DAY * PS:
        raise InputError(
            f"{key}.timing", f"at least {at_least(1 / DAY)} Hz, a period in the longest duration",
            f"{section.timing:g} Hz", "raise it",
        )  # fmt: skip
    shortest = seconds_to_ps(section.shortest_width)
    if shortest < tick:
        raise InputError(
            f"{key}.shortest_width", f"at least a period of the timing clock, {tick} ps",
            f"{shortest} ps", "lengthen it or raise timing",
        )  # fmt: skip
    longest = 0 if section.longest_width is None else seconds_to_ps(section.longest_width)
    if longest and longest < shortest:
        raise InputError(
            f"{key}.longest_width", f"at least the shortest, {at_least(section.shortest_width)} s",
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
        setting.seed,
        clock,
        shortest,
        longest,
        section.levels,
        seconds_to_ps(sensor.comparator_delay),
        seconds_to_ps(sensor.dead_time),
        section.change,
    )


def _threshold(sensor: SensorSection, setting: CameraSetting) -> int:
    """Whole electrons at the level chosen. Raises InputError for a fraction."""
    chosen = setting.threshold
    if chosen == round(chosen):
        return round(chosen)
    what, remedy = "sensor.threshold", f"write {round(chosen)} e"
    levels = setting.chip.threshold_levels
    if sensor.threshold_level != levels:
        what += f" at level {sensor.threshold_level} of {levels}"
        remedy = f"choose a sensor.threshold_level that parts {sensor.threshold:g} e evenly"
    raise InputError(what, "whole electrons with pixel = asynchronous", f"{chosen:g} e", remedy)


def channel_model(sensor: SensorSection) -> ChannelModel | None:
    """The shared output; None where every event leaves as its pixel fires."""
    section = sensor.channel
    if section is None:
        return None
    if section.buffer == "fifo" and section.arbitration != "fifo":
        raise InputError(
            "sensor.channel.arbitration", "fifo with buffer = fifo: a queue is served in order",
            section.arbitration, "change one of them",
        )  # fmt: skip
    if section.rate * DAY < 1:
        raise InputError(
            "sensor.channel.rate", f"at least {at_least(1 / DAY)} Hz, an event in the longest "
            "duration", f"{section.rate:g} Hz", "raise it",
        )  # fmt: skip
    return ChannelModel(
        max(1, round(PS / section.rate)), section.arbitration, section.buffer, section.depth
    )
