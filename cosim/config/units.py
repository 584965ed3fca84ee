"""Quantities as text with units, and kinds of quantities.

pint parses the text, and a *kind* lists the accepted units, with any SI prefix. Dimensions alone do
not suffice: they do not distinguish lux from cd/m2, as a steradian has no dimension, and a pixel is
a length for pint.
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, cast

from cosim.config.unit_table import UNITS

if TYPE_CHECKING:
    import pint

_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
# pint evaluates expressions in a unit, and "s*9**9**9" would not end. Therefore only names with a
# small power, joined by one sign, are passed to it.
_POWER = r"(?:\ ?(?:\*\*|\^)\ ?-?[1-9]|[23²³]|⁻[¹²³])?"
_NAME = rf"[A-Za-zµμ_]+{_POWER}"
_UNIT = rf"(?:1\ ?/\ ?)?{_NAME}(?:(?:\ ?[*/·]\ ?|\ ){_NAME})*"
_LONGEST = 200
"""Characters of a quantity. Time grows with the square of the digits, and in pint of a name."""
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*({_UNIT})\s*")
_PLAIN_POWER = re.compile(r"(?<=[A-Za-zµμ_])(?=[23])")
"""Place of the sign that pint wants in "m2"."""
_COMMON = {
    "s": {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "Hz": {"kHz": 1e3, "MHz": 1e6, "GHz": 1e9},
    "bit/s": {"kbit/s": 1e3, "Mbit/s": 1e6, "Gbit/s": 1e9},
    "lux": {"klux": 1e3},
    "V": {"mV": 1e-3},
    "ohm": {"kohm": 1e3},
    "um": {"m": 1e6, "cm": 1e4, "mm": 1e3, "nm": 1e-3},
    "Pa": {"kPa": 1e3},
    "W": {"mW": 1e-3},
}
"""Factors of the units that most scenarios have, by the unit of the kind: pint's own, which a test
compares. It takes 0.2 s to import, and is asked for the other units alone."""
_BASE = {"um": ("m", 1e-6), "nm": ("m", 1e-9), "fF": ("F", 1e-15)}
"""Base unit and size of the units that have a prefix themselves."""
_PREFIXED = frozenset({"s", "Hz", "bit/s", "m", "F", "V", "ohm", "Pa", "W"})
"""Units that are read with an SI prefix."""
_PREFIXES = {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "u", 1e-9: "n", 1e-15: "f"}


@dataclass(frozen=True)
class Kind:
    """A kind of quantity.

    Attributes:
        name: name in messages.
        unit: unit of values in this project.
        example: valid text.
        accepted: accepted units as products of pint's unit names, without prefixes.
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
        Kind("bit rate", "bit/s", "8 Gbit/s", ("bit / second",)),
        Kind("illuminance", "lux", "700 lux", ("lux", "lumen / meter ** 2")),
        Kind("luminance", "cd/m²", "300 cd/m²", ("candela / meter ** 2",)),
        Kind("speed", "px/s", "4000 px/s", ("css_pixel / second",)),  # px in pint
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


def _factor(text: str, kind: Kind) -> float | None:
    """What pint multiplies values in a common unit by; None for another one."""
    text = text.replace("m2", "m²")
    return 1.0 if text == kind.unit else _COMMON.get(kind.unit, {}).get(text)


@cache
def _registry() -> pint.UnitRegistry:
    # It would import Dask, which takes as long again and is used for arrays with units alone: None
    # hides it.
    hidden: Any = sys.modules.setdefault("dask", cast(Any, None))
    try:
        import pint
    finally:
        if hidden is None:
            del sys.modules["dask"]
    return pint.UnitRegistry(UNITS.splitlines())


def _without_prefixes(unit: pint.Unit) -> str:
    """The unit without SI prefixes, as canonical text ("kilolux" -> "lux")."""
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
    """The number in `text`, in the unit of the kind.

    Raises ValueError ("must be a frequency such as '40 kHz', not '40 lux'") if the text is not a
    finite number with a unit of this kind.
    """
    match = _QUANTITY.fullmatch(text) if len(text) <= _LONGEST else None
    if match is None:
        raise ValueError(f"must be {kind}, not {text!r}")
    factor = _factor(match[2], kind)
    if factor is not None:
        value = float(match[1]) * factor
        if not math.isfinite(value):
            raise ValueError(f"must be {kind}, not {text!r}")
        return value
    ureg = _registry()
    try:
        unit = ureg.Unit(_PLAIN_POWER.sub("^", match[2]))
        allowed = _without_prefixes(unit) in _accepted(kind)
        magnitude = ureg.Quantity(float(match[1]), unit).to(kind.unit).magnitude if allowed else 0
    except Exception as exc:  # pint raises many types for text that is no unit
        raise ValueError(f"must be {kind}, not {text!r}") from exc
    if not allowed or not math.isfinite(magnitude):
        raise ValueError(f"must be {kind}, not {text!r}")
    return float(magnitude)


def format_quantity(value: float, kind: Kind) -> str:
    """Text from which `parse_quantity` returns the same float."""
    number = f"{value:.12g}"
    if float(number) != value:
        number = repr(float(value))
    return f"{number} {kind.unit}"


def readable_quantity(value: float, kind: Kind) -> str:
    """The quantity with the prefix that leaves few digits ("2 m", not "2000000 um").
    `parse_quantity` returns the same float, else the text is that of `format_quantity`."""
    unit, size = _BASE.get(kind.unit, (kind.unit, 1.0))
    base = abs(value) * size
    if unit not in _PREFIXED or not base:
        return format_quantity(value, kind)
    prefix = max((p for p in _PREFIXES if p <= base * (1 + 1e-9)), default=min(_PREFIXES))
    text = f"{value * size / prefix:.12g} {_PREFIXES[prefix]}{unit}"
    return text if parse_quantity(text, kind) == value else format_quantity(value, kind)
