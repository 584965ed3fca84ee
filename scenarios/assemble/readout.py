"""Keys of [sensor] and options that belong to one readout only."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cosim import InputError
from scenarios.assemble.schema.scenario import Scenario

__all__ = ["refuse_device", "refuse_keys", "refuse_leftovers", "with_section"]

_SECTIONS = {
    "asynchronous": "asynchronous",
    "channel": "asynchronous",
    "continuous": "continuous",
    "circuit": "synchronous",
}
"""Sections of [sensor] that belong to one readout, and which."""


def refuse_leftovers(scenario: Scenario) -> None:
    """Raises InputError where a chip is given what only one of another readout has."""
    has = scenario.sensor.readout
    if scenario.sensor.source is not None and has != "synchronous":
        raise InputError(
            "sensor.source", "absent unless sensor.readout = synchronous", f"given with {has}",
            "leave it out: the board latches its spikes by a clock",
        )  # fmt: skip
    if scenario.display is not None and has != "synchronous":
        raise InputError(
            "display", "absent unless sensor.readout = synchronous", f"given with {has}",
            "leave it out, or set sensor.readout=synchronous",
        )  # fmt: skip
    for name, readout in _SECTIONS.items():
        if getattr(scenario.sensor, name) is not None and has != readout:
            raise InputError(
                f"sensor.{name}", f"given with sensor.readout = {readout}", f"with {has}",
                f"set sensor.readout={readout} or leave it out",
            )  # fmt: skip


def refuse_keys(readout: str, keys: Iterable[tuple[str, Any, Any]], remedy: str) -> None:
    """Raises InputError where a key of [sensor] (name, value, plain) is not what pixels without
    its meaning have."""
    for name, value, plain in keys:
        if value != plain:
            must = "absent" if plain is None else plain
            raise InputError(
                f"sensor.{name}", f"{must} with readout = {readout}", str(value), remedy
            )


def refuse_device(readout: str, device: str | None) -> None:
    """Raises InputError for a device, which only the synchronous camera chooses."""
    if device is not None and device.lower() != "numba":
        raise InputError(
            "--device", f"numba with readout = {readout}", device, "leave it out: these pixels "
            "run on the processor",
        )  # fmt: skip


def with_section(scenario: Scenario, name: str, default: Any) -> Scenario:
    """The scenario with [sensor.name] written out."""
    if getattr(scenario.sensor, name) is not None:
        return scenario
    sensor = scenario.sensor.model_copy(update={name: default})
    return scenario.model_copy(update={"sensor": sensor})
