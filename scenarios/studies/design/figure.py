"""Draws dynamic range against each quantity of a budget with more than one value."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from cosim.report.figures import INK, LINE, MARK, subplots

_TITLES: Final = {
    "sensor": "sensor", "adc": "converter", "temperature": "sensor temperature, degC",
    "clock": "pixel clock, MHz", "circuit_noise": "circuit noise, mV RMS",
    "analog_gain": "analog gain", "digital_gain": "digital gain",
}  # fmt: skip
_SCALE: Final = {"clock": 1e-6, "circuit_noise": 1e3}
_BLUE: Final = "#2f5fa8"


def _varied(document: dict[str, Any], key: str) -> list[tuple[Any, float, float, float | None]]:
    """The points of one plot.

    Returns:
        For each value of `key`: the value; the derived range and that of the document's formula,
        dB, with all other quantities as in the best choice; and the largest derived range of all
        choices with this value within the limits, dB, or None.
    """
    base = document["best"] or document["rows"][0]
    others = [k for k in document["swept"] if k != key]
    points = []
    for value in document["swept"][key]:
        rows = [row for row in document["rows"] if row[key] == value]
        alike = next(row for row in rows if all(row[k] == base[k] for k in others))
        allowed = [row["dr_db"] for row in rows if row["allowed"]]
        points.append((value, alike["dr_db"], alike["dr_document_db"], max(allowed, default=None)))
    return points


def draw_budget(document: dict[str, Any], path: Path, kind: str) -> None:
    """Draws the document of `budget_document` to a file of the kind png or svg."""
    keys = [key for key, values in document["swept"].items() if len(values) > 1] or ["sensor"]
    columns = min(len(keys), 3)
    lines = -(-len(keys) // columns)
    figure, axes = subplots(
        lines, columns, figsize=(4.6 * columns + 0.4, 3.7 * lines + 0.9), squeeze=False, sharey=True
    )
    for ax in axes.ravel()[len(keys) :]:
        ax.remove()
    for key, ax in zip(keys, axes.ravel(), strict=False):
        _panel(ax, key, _varied(document, key))
    axes[0, 0].legend(fontsize=8, frameon=False, loc="lower left")
    for row in axes:
        row[0].set_ylabel("dynamic range, dB", fontsize=9, color=INK)
    best = document["best"]
    first = best or document["rows"][0]
    words = "best choice" if best else "no choice is within the limits; best without them"
    figure.suptitle(
        f"{words}: {first['sensor']}, {first['adc']}, {first['temperature']:g} degC, "
        f"{first['clock'] / 1e6:g} MHz, circuit {first['circuit_noise'] * 1e3:g} mV, analog "
        f"{first['analog_gain']:g}, digital {first['digital_gain']:g}: {first['dr_db']:.1f} dB",
        fontsize=11, color=INK,
    )  # fmt: skip
    figure.tight_layout()
    figure.savefig(path, dpi=110, format=kind)


def _panel(ax: Any, key: str, points: list[tuple[Any, float, float, float | None]]) -> None:
    values = [p[0] for p in points]
    named = isinstance(values[0], str)
    x = list(range(len(values))) if named else [v * _SCALE.get(key, 1) for v in values]
    style = "o" if named else "o-"
    ax.plot(x, [p[1] for p in points], style, color=_BLUE, markersize=5,
            label="derived, other quantities as in the title")  # fmt: skip
    ax.plot(x, [p[2] for p in points], "s" if named else "s--", color=MARK, markersize=4,
            linewidth=1, label="formula of the document")  # fmt: skip
    allowed = [(a, p[3]) for a, p in zip(x, points, strict=True) if p[3] is not None]
    if allowed:
        ax.plot(*zip(*allowed, strict=True), "_", color=INK, markersize=16, markeredgewidth=1.5,
                label="best within the limits")  # fmt: skip
    if named:
        ax.set_xticks(x, values, rotation=20, ha="right")
        ax.set_xlim(-0.5, len(x) - 0.5)
    elif key.endswith("gain"):
        ax.set_xscale("log", base=2)
        ax.set_xticks(x, [f"{v:g}" for v in x])
        ax.minorticks_off()
    ax.set_xlabel(_TITLES[key], fontsize=9, color=INK)
    ax.grid(color=LINE, linewidth=0.5)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(LINE)
    ax.tick_params(colors=INK, labelsize=8.5)
