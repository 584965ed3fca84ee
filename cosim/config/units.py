"""Quantities as text with units, and kinds of quantities.

pint parses the text, and a *kind* lists the accepted units, with any SI prefix. Dimensions alone do
not suffice: they do not distinguish lux from cd/m2, as a steradian has no dimension, and a pixel is
a length for pint.

pint takes 0.13 s to read its own thousand units, of which the kinds of quantities accept those of
UNITS. All others are refused in any case, so little else changes: `fm` is a femtometre and not a
fermi, and a few names of pint's other units, such as `yd`, are now those of these units with a
prefix.
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, cast

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
UNITS = """
quecto- = 1e-30 = q-
ronto- = 1e-27 = r-
yocto- = 1e-24 = y-
zepto- = 1e-21 = z-
atto- = 1e-18 = a-
femto- = 1e-15 = f-
pico- = 1e-12 = p-
nano- = 1e-9 = n-
micro- = 1e-6 = \u00b5- = \u03bc- = u- = mu- = mc-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
deca- = 1e+1 = da- = deka-
hecto- = 1e2 = h-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
tera- = 1e12 = T-
peta- = 1e15 = P-
exa- = 1e18 = E-
zetta- = 1e21 = Z-
yotta- = 1e24 = Y-
ronna- = 1e27 = R-
quetta- = 1e30 = Q-
kibi- = 2**10 = Ki-
mebi- = 2**20 = Mi-
gibi- = 2**30 = Gi-
tebi- = 2**40 = Ti-
pebi- = 2**50 = Pi-
exbi- = 2**60 = Ei-
zebi- = 2**70 = Zi-
yobi- = 2**80 = Yi-
semi- = 0.5 = _ = demi-
sesqui- = 1.5
meter = [length] = m = metre
second = [time] = s = sec
ampere = [current] = A = amp
candela = [luminosity] = cd = candle
gram = [mass] = g
kelvin = [temperature]; offset: 0 = K = degK = \u00b0K = degree_Kelvin = degreeK
radian = [] = rad
bit = []
css_pixel = 0.0254 * meter / 96 = px
minute = 60 * second = min
hour = 60 * minute = h = hr
day = 24 * hour = d
degree = 3.141592653589793 / 180 * radian = deg = arcdeg = arcdegree = angular_degree
steradian = radian ** 2 = sr
hertz = 1 / second = Hz
newton = kilogram * meter / second ** 2 = N
joule = newton * meter = J
watt = joule / second = W
pascal = newton / meter ** 2 = Pa
bar = 1e5 * pascal
standard_atmosphere = 1.01325e5 * pascal = atm = atmosphere
torr = atm / 760
degree_Celsius = kelvin; offset: 273.15 = \u00b0C = celsius = degC = degreeC
lumen = candela * steradian = lm
lux = lumen / meter ** 2 = lx
coulomb = ampere * second = C
elementary_charge = 1.602176634e-19 * coulomb = e
volt = joule / coulomb = V
ohm = volt / ampere = \u03a9
farad = coulomb / volt = F
"""


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
