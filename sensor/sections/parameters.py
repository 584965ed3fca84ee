"""From the [sensor] section to the parameters of the effects."""

from __future__ import annotations

from typing import Any

from cosim.errors import InputError
from sensor.latched.effects.catalogue import CATALOGUE
from sensor.latched.effects.effect import Operation
from sensor.sections.sensor import SensorSection


def effect_parameters(section: SensorSection, operation: Operation) -> dict[str, Any]:
    """Parameters of every effect, by name. Raises InputError for what cannot be simulated."""
    parameters: dict[str, Any] = {}
    for effect in CATALOGUE:
        for name, key in effect.keys.items():
            value, default = getattr(section, name), key.field.get_default()
            if section.pixel not in key.pixels and value != default:
                raise InputError(
                    f"sensor.{name}", f"absent with pixel = {section.pixel}", f"{value:g}",
                    "leave it out: these pixels have no such effect",
                )  # fmt: skip
        parameters |= effect.configure(section, operation)
    return parameters
