"""Text of numbers for people, in one style: counts, quantities with units, shares, levels, times.

Thousands are separated by a narrow no-break space from 10 000 on (SI brochure, 9th edition, 5.4.4).
A whole number is printed whole, any other is rounded to three significant digits unless asked
otherwise, and powers of ten stand only beyond 1e-4 to 1e6. Superscripts are characters, so the same
text serves a terminal, a page and a figure.
"""

from __future__ import annotations

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from typing import Final

THIN: Final = "\N{NARROW NO-BREAK SPACE}"
"""Separator of thousands."""
UNKNOWN: Final = "unknown"
"""Text of a number that is not known."""
_SMALL, _LARGE, _COUNT = 1e-4, 1e6, 1e10
"""Sizes beyond which a number, or a whole number, is printed with a power of ten."""
_RATES = (
    "bit/s", "B/s", "pixel-cycles/s", "pixel-frames/s", "pixels/s", "events/s", "planes/s",
    "spikes/s",
)  # fmt: skip
"""Units that take a prefix for large values."""
_MANY = ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"))
_TIMES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"), (1e-12, "ps"))
_WAITS = (("min", 60, "s", 1, 60), ("h", 3600, "min", 60, 48), ("d", 86400, "h", 3600, math.inf))
"""Unit, its length in s, the unit of the rest, its length, and how many units one waits at most."""
_SIGNS = {
    "us": "µs", "um": "µm", "V/um": "V/µm", "cd/m2": "cd/m²", "degC": "°C",
}  # fmt: skip
"""Units as printed, where documents for programs spell them otherwise."""
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_BEST: Final = 100.0
"""Ratio beyond which a signal differs from the truth by the rounding of float32 alone, dB."""


def _grouped(digits: str) -> str:
    """Digits, with or without a sign and decimals, in groups of three from five places on."""
    whole, point, rest = digits.partition(".")
    sign = whole[0] if whole[0] in "+-" else ""
    whole = whole.removeprefix(sign)
    if len(whole) > 4:
        whole = f"{int(whole):,}".replace(",", THIN)
    return sign + whole + point + rest


def count(value: float | None) -> str:
    """Text of a count: "19 209" for 19209, "unknown" for None and NaN."""
    if value is None or math.isnan(value):
        return UNKNOWN
    return _grouped(f"{value:.0f}")


def number(value: float | None, digits: int = 3, *, sign: bool = False) -> str:
    """Text of a number without a unit.

    Args:
        value: the number; None and NaN are unknown.
        digits: significant digits of what is no whole number.
        sign: whether a positive number has a sign.
    """
    if value is None or math.isnan(value):
        return UNKNOWN
    plus = "+" if sign else ""
    if math.isinf(value):
        return f"{'-' if value < 0 else plus}\N{INFINITY}"
    if float(value).is_integer() and abs(value) < _COUNT:
        return _grouped(f"{value:{plus}.0f}") if value else "0"
    mantissa, power = f"{value:{plus}.{digits - 1}e}".split("e")
    rounded = float(f"{mantissa}e{power}")
    if _SMALL <= abs(rounded) < _LARGE:
        places = max(digits - 1 - int(power), 0)
        text = f"{rounded:{plus}.{places}f}"
        return _grouped(text.rstrip("0").rstrip(".") if "." in text else text)
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{mantissa} × 10{str(int(power)).translate(_RAISED)}"


def at_least(value: float, digits: int = 6) -> str:
    """Text of a lower limit that a user is to write, rounded up: what he copies is accepted."""
    return _limit(value, digits, ROUND_CEILING)


def at_most(value: float, digits: int = 6) -> str:
    """Text of an upper limit that a user is to write, rounded down: what he copies is accepted."""
    return _limit(value, digits, ROUND_FLOOR)


def _limit(value: float, digits: int, towards: str) -> str:
    if not math.isfinite(value):
        return f"{value:g}"
    near = Decimal(f"{value:.15g}")  # 0.1 + 0.2 is 0.3, and not more
    return f"{float(Context(digits, towards).create_decimal(near)):.12g}"


def percent(share: float | None, digits: int = 3, *, sign: bool = False) -> str:
    """Text of a share: "12.3 %" for 0.123. What is nearly all is not rounded to all of it."""
    if share is None or math.isnan(share):
        return UNKNOWN
    text = number(100 * share, digits, sign=sign)
    if share < 1 and text.lstrip("+") == "100":
        return f"over {'99.' + '9' * (digits - 2) if digits > 2 else '99'} %"
    return f"{text} %"


def decibel(value: float | None) -> str:
    """Text of a ratio of signal to error, dB, with one decimal. What differs from the truth by
    rounding alone is "over 100 dB", and what is equal "exact"."""
    if value is None or math.isnan(value):
        return UNKNOWN
    if math.isinf(value):
        return "exact"
    return f"over {_BEST:.0f} dB" if value > _BEST else f"{value:.1f} dB"


def elapsed(seconds: float | None) -> str:
    """Text of a time that people wait: "12.3 s", "37 min 30 s", "2 h 5 min", "3 d 4 h"."""
    if seconds is None or not math.isfinite(seconds):
        return UNKNOWN
    if seconds < 99.95:
        return amount(seconds, "s")
    large, size, small, part, _ = next(
        row for row in _WAITS if round(seconds / row[3]) * row[3] < row[4] * row[1]
    )
    whole, rest = divmod(round(seconds / part), size // part)
    return f"{count(whole)} {large}" + (f" {rest} {small}" if rest else "")


def amount(value: float | None, unit: str, digits: int = 3) -> str:
    """Text of a figure: "80 Mbit/s" for 8e7 bit/s, "4 ms" for 0.004 s, "85 897" for 85897.

    Args:
        value: the figure; None and NaN are unknown.
        unit: its unit; "1" for none.
        digits: significant digits, of what is no whole number. The figure is rounded before its
            prefix is selected.
    """
    if value is None or math.isnan(value):
        return UNKNOWN
    rounded = abs(float(f"{value:.{digits}g}"))
    sign = _SIGNS.get(unit, unit)
    if unit in _RATES:
        for size, prefix in _MANY:
            if rounded >= size:
                return f"{value / size:.{digits}g} {prefix}{sign}"
    if unit == "s" and rounded:
        size, name = next((t for t in _TIMES if rounded >= t[0]), _TIMES[-1])
        return f"{number(value / size, digits)} {name}"
    text = number(value, digits)
    if unit == "1":
        return text
    return f"{text}{sign[1:]}" if sign.startswith("1/") else f"{text} {sign}"
