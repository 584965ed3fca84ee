"""Rejects keys of [sensor] and options that pixels of the selected kind do not have."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cosim import InputError
from scenarios.assemble.schema.scenario import Scenario

_SECTIONS = {
    "asynchronous": "asynchronous",
    "channel": "asynchronous",
    "continuous": "continuous",
    "circuit": "latched",
    "sub_threshold": "latched",
    "dark_limit": "latched",
    "colour": "latched",
}
"""Sections and keys of [sensor] that exist for one kind of pixel only, with that kind."""
_BEYOND = ("writes", "sub_threshold", "dark_limit")
"""Keys of [sensor] by which a latched chip says more than its spikes, or rejects some."""


def says_more(scenario: Scenario) -> list[str]:
    """Those of `_BEYOND` that a scenario has, with their section."""
    return [f"sensor.{name}" for name in _BEYOND if getattr(scenario.sensor, name)]


def refuse_beyond(scenario: Scenario, what: str, why: str) -> None:
    """Raises InputError for a chip that says more than its spikes. what, why: what does not follow
    it, and the reason, for the message."""
    for key in says_more(scenario):
        must = "empty" if key == "sensor.writes" else "absent"
        raise InputError(key, f"{must} with {what}", "given", f"leave one of them out: {why}")


def refuse_leftovers(scenario: Scenario) -> None:
    """Raises InputError for sections and keys that only another kind of pixel has."""
    current = scenario.sensor.pixel
    sink = None if scenario.display is None else scenario.display.sink
    if sink is not None and scenario.sensor.sub_threshold is not None:
        raise InputError(
            "sensor.sub_threshold", "absent with display.sink", "given",
            "leave one of them out: a board displays the spikes alone",
        )  # fmt: skip
    for name, pixel in _SECTIONS.items():
        if getattr(scenario.sensor, name) is not None and current != pixel:
            raise InputError(
                f"sensor.{name}", f"given with sensor.pixel = {pixel}", f"with {current}",
                f"set sensor.pixel={pixel} or leave it out",
            )  # fmt: skip


def refuse_keys(pixel: str, keys: Iterable[tuple[str, Any, Any]], remedy: str) -> None:
    """Raises InputError for keys that have no meaning for pixels of a kind.

    Args:
        pixel: the kind, for the message.
        keys: (name, value, default) of keys of [sensor]; each value must equal its default.
        remedy: last part of the message.
    """
    for name, value, default in keys:
        if value != default:
            must = "absent" if default is None else default
            raise InputError(f"sensor.{name}", f"{must} with pixel = {pixel}", str(value), remedy)


def refuse_device(pixel: str, device: str | None) -> None:
    """Raises InputError for an OpenCL device, which only latched pixels support."""
    if device is not None and device.lower() != "numba":
        raise InputError(
            "--device", f"numba with pixel = {pixel}", device, "leave it out: these pixels "
            "run on the processor",
        )  # fmt: skip


def with_section(scenario: Scenario, name: str, default: Any) -> Scenario:
    """The scenario with the section [sensor.`name`], by default `default`, written out."""
    if getattr(scenario.sensor, name) is not None:
        return scenario
    sensor = scenario.sensor.model_copy(update={name: default})
    return scenario.model_copy(update={"sensor": sensor})
