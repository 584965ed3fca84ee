"""Text of figures with a unit, with SI prefixes."""

from __future__ import annotations

__all__ = ["amount"]

_RATES = ("bit/s", "pixel-cycles/s", "pixels/s", "events/s", "planes/s", "spikes/s")
"""Units that take a prefix for large values."""
_MANY = ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"))
_TIMES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"), (1e-12, "ps"))


def amount(value: float, unit: str, digits: int = 3) -> str:
    """Text of a figure: "80 Mbit/s" for 8e7 bit/s, "4 ms" for 0.004 s, "85,897" for 85 897.

    Args:
        value: the figure.
        unit: its unit; "1" for none.
        digits: significant digits, of what is no whole number. The figure is rounded before its
            prefix is selected.
    """
    rounded = abs(float(f"{value:.{digits}g}"))
    if unit in _RATES:
        for size, prefix in _MANY:
            if rounded >= size:
                return f"{value / size:.{digits}g} {prefix}{unit}"
    if unit == "s" and rounded:
        size, name = next((t for t in _TIMES if rounded >= t[0]), _TIMES[-1])
        return f"{value / size:.{digits}g} {name}"
    number = f"{value:.{digits}g}"
    if float(value).is_integer() and abs(value) < 1e10 and unit != "s":  # a count is printed whole
        number = f"{value:,.0f}" if abs(value) >= 1e4 else f"{value:.0f}"
    elif 10**digits <= rounded < 1e9:
        number = f"{float(number):,.0f}"
    return number if unit == "1" else f"{number} {unit}"
