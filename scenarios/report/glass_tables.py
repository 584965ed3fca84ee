"""Tables of a display's page."""

from __future__ import annotations

import math

from scenarios.glass import Shown
from scenarios.glass.finish import title_of
from scenarios.report.parts import table

__all__ = ["band_table", "display_table"]


def number(value: float | None, digits: str = ".3g", unit: str = "") -> str:
    """A figure as a table has it; nothing where there is none."""
    if value is None or math.isnan(value):
        return ""
    return "exact" if math.isinf(value) else f"{value:{digits}}{unit}"


def display_table(shown: Shown) -> str:
    """A row for each display."""
    head = ["display", "PSNR still", "SSIM still", "PSNR pursuing", "SSIM pursuing"]
    rows = []
    for display in shown.displays:
        still, moving = (shown.judged_as(display, who) for who in ("eye", "pursuit"))
        rows.append([
            title_of(shown, display), number(still.psnr, ".1f", " dB"), number(still.ssim, ".3f"),
            number(moving.psnr, ".1f", " dB"), number(moving.ssim, ".3f"),
        ])  # fmt: skip
    return table(head, rows)


def band_table(shown: Shown) -> str:
    """Fidelity by luminance: a row for each band, a column for each display."""
    judged = {name: shown.judged_as(name, "eye") for name in shown.displays}
    some = next(iter(judged.values()))
    head = ["luminance", "of all pixels", *(title_of(shown, name) for name in judged)]
    rows = []
    for n, band in enumerate(some.bands):
        row = [f"{band.low:g} to {band.high:g}", f"{band.share:.1%}"]
        for one in judged.values():
            of = one.bands[n]
            row.append(
                f"{number(of.psnr, '.1f', ' dB')}, {number(100 * of.bias, '+.2g', ' %')}, "
                f"± {number(100 * of.spread, '.2g', ' %')}"
            )
        rows.append(row)
    return table(head, rows)
