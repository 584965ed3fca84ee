"""Quantities as text with units, and the kinds that dimensions alone do not tell apart.

pint reads the text; a *kind* says which units may stand for it. Dimensional analysis cannot see
that lux is not cd/m2 (steradian has no dimension) or that a pixel is no length (pint says it is),
so a kind lists the units it accepts, any SI prefix allowed.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pint

__all__ = ["KINDS", "Kind", "format_quantity", "parse_quantity"]


@dataclass(frozen=True)
class Kind:
    """A kind of quantity: its unit in this project, the units accepted, an example.

    accepted: products of unit names as pint spells them, without prefixes.
    """

    name: str
    unit: str
    example: str
    accepted: tuple[str, ...]

    def __str__(self) -> str:
        article = "an" if self.name[0] in "aeiou" else "a"
        return f"{article} {self.name} such as '{self.example}'"


KINDS: dict[str, Kind] = {
    k.name: k
    for k in (
        Kind("time", "s", "64 ms", ("second", "minute", "hour", "day")),
        Kind("frequency", "Hz", "40 kHz", ("hertz", "1 / second")),
        Kind("illuminance", "lux", "700 lux", ("lux", "lumen / meter ** 2")),
        Kind("luminance", "cd/m²", "300 cd/m²", ("candela / meter ** 2",)),
        Kind("speed", "px/s", "4000 px/s", ("css_pixel / second",)),  # px, as pint knows it
        Kind("charge", "e", "1000 e", ("elementary_charge", "coulomb")),
        Kind("current", "e/s", "40 e/s", ("elementary_charge / second", "ampere")),
        Kind("capacitance", "fF", "15 fF", ("farad",)),
        Kind("voltage", "V", "0.5 V", ("volt",)),
        Kind("resistance", "ohm", "10 kohm", ("ohm",)),
        Kind("temperature", "degC", "25 degC", ("degree_Celsius", "kelvin")),
        Kind("length", "um", "10 um", ("meter",)),
        Kind("angle", "deg", "15 deg", ("degree", "radian")),
        Kind("pressure", "Pa", "9 kPa", ("pascal", "bar", "torr", "atmosphere")),
        Kind("wavelength", "nm", "555 nm", ("meter",)),
        Kind("power", "W", "2 W", ("watt",)),
        Kind("conversion gain", "uV/e", "25 uV/e", ("volt / elementary_charge",)),
    )
}

_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
# pint computes what stands in a unit, so that "s*9**9**9" would keep it busy for ever: only names
# with a small power, joined by one sign, are let through to it.
_POWER = r"(?:\ ?(?:\*\*|\^)\ ?-?[1-9]|[²³]|⁻[¹²³])?"
_NAME = rf"[A-Za-zµμ_]+{_POWER}"
_UNIT = rf"(?:1\ ?/\ ?)?{_NAME}(?:(?:\ ?[*/·]\ ?|\ ){_NAME})*"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*({_UNIT})\s*")


@cache
def _registry() -> pint.UnitRegistry:
    import pint  # 0.3 s: only commands that read a scenario pay for it

    return pint.UnitRegistry()


def _without_prefixes(unit: pint.Unit) -> str:
    """The unit with every SI prefix taken off, as canonical text ("kilolux" -> "lux")."""
    ureg = _registry()
    bare = ureg.Unit("")
    for name, power in unit._units.items():
        (_, root, _), *_ = ureg.parse_unit_name(name)
        bare *= ureg.Unit(root) ** power
    return str(bare)


@cache
def _accepted(kind: Kind) -> frozenset[str]:
    return frozenset(str(_registry().Unit(text)) for text in kind.accepted)


def parse_quantity(text: str, kind: Kind) -> float:
    """Magnitude of `text` in the kind's unit.

    Raises ValueError ("must be a frequency such as '40 kHz', not '40 lux'") when the text is not
    a finite number with a unit of this kind.
    """
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise ValueError(f"must be {kind}, not {text!r}")
    ureg = _registry()
    try:
        unit = ureg.Unit(match[2])
        allowed = _without_prefixes(unit) in _accepted(kind)
        magnitude = ureg.Quantity(float(match[1]), unit).to(kind.unit).magnitude if allowed else 0
    except Exception as exc:  # pint raises a dozen types for text that is no unit
        raise ValueError(f"must be {kind}, not {text!r}") from exc
    if not allowed or not math.isfinite(magnitude):
        raise ValueError(f"must be {kind}, not {text!r}")
    return float(magnitude)


def format_quantity(value: float, kind: Kind) -> str:
    """Text that `parse_quantity` reads back to the same float."""
    number = f"{value:.12g}"
    if float(number) != value:
        number = repr(float(value))
    return f"{number} {kind.unit}"
