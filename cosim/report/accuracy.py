"""The figure of `viform accuracy`: error against time per pixel-cycle, a line for each tier."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from cosim.files.atomic import atomic_write
from cosim.report.figures import INK, LINE, MARK, subplots

_CHANCE: Final = "chance in one window of one tile's mean"
_COLOURS: Final = {"fast": "#1c7ed6", "exact": "#2b8a3e", "reference": INK}


def _points(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows with a known error and time, the loosest tolerance first."""
    known = [r for r in rows if r["error"] is not None and r["ns_per_pixel_cycle"]]
    return sorted(known, key=lambda r: -(r["tolerance"] or 0.0))


def _labels(
    axes: Any, points: list[dict[str, Any]], colour: str, bottom: float, below: bool
) -> None:
    """Labels the points with their tolerances; overlapping points share a label."""
    import math

    groups: list[tuple[float, float, list[str]]] = []
    for row in points:
        x, y = math.log10(row["ns_per_pixel_cycle"]), math.log10(max(row["error"], bottom))
        for gx, gy, texts in groups:
            if abs(gx - x) < 0.12 and abs(gy - y) < 0.25:
                texts.append(f"{row['tolerance']:g}")
                break
        else:
            groups.append((x, y, [f"{row['tolerance']:g}"]))
    for x, y, texts in groups:
        axes.annotate(
            ", ".join(texts), (10**x, 10**y), fontsize=8, color=colour,
            xytext=(0, -14 if below else 8), textcoords="offset points", ha="center",
        )  # fmt: skip


def accuracy_figure(name: str, document: dict[str, Any], path: Path) -> None:
    """Draws the document of `viform accuracy` to a PNG."""
    rows, floor = document["rows"], document["floor"]
    cost = document["reference"]["ns_per_pixel_cycle"]
    figure, axes = subplots(figsize=(9.5, 6))
    axes.set_xscale("log")
    axes.set_yscale("log")
    reference = floor["reference"] or 1.0
    of_bits = "bits" in document["reference"]
    bottom = min([reference, *(r["error"] for r in rows if r["error"])]) / 10
    if of_bits and floor["monte_carlo"]:  # bits resolve no lower errors
        bottom = max(bottom, floor["monte_carlo"] / 1e4)
    tiers = [t for t in ("exact", "fast") if any(r["tier"] == t for r in rows)]
    for n, tier in enumerate(tiers):
        points = _points([r for r in rows if r["tier"] == tier])
        x = [r["ns_per_pixel_cycle"] for r in points]
        y = [max(r["error"], bottom) for r in points]
        low = [
            max(v - max((r["ci"] or (v, v))[0], bottom), 0) for v, r in zip(y, points, strict=True)
        ]
        high = [max((r["ci"] or (v, v))[1] - v, 0) for v, r in zip(y, points, strict=True)]
        axes.errorbar(
            x, y, yerr=[low, high], marker="o", markersize=5, linewidth=1.3, capsize=3,
            color=_COLOURS[tier], label=f"{tier} tier, tolerance at its points",
        )  # fmt: skip
        _labels(axes, points, _COLOURS[tier], bottom, below=n == 0)
    chance = "what these bits alone tell of their rate" if of_bits else _CHANCE
    _lines(
        axes,
        floor | {"reference": floor["reference"] if reference > bottom else None},
        cost,
        chance,
    )
    failed = [r for r in rows if r.get("failed")]
    for n, row in enumerate(failed):
        text = f"{row['tier']}, tolerance {row['tolerance']:g}: failed, {row['failed'][:90]}"
        axes.text(0.01, 0.02 + 0.04 * n, text, transform=axes.transAxes, fontsize=8, color=MARK)
    order = document["order"]
    label = "no order can be fitted" if order is None else f"error ~ tolerance$^{{{order:.2f}}}$"
    axes.set_title(f"{name}: error against run time; {label}", fontsize=11, color=INK)
    cycle = "pixel-frame" if "frames" in document["reference"] else "pixel-cycle"
    axes.set_xlabel(f"time of the camera, ns a {cycle}", color=INK)
    label = "relative\n(worst tile; bars: 99.9 %)"
    if of_bits:
        label = f"of the\n{document['error_of']} (bars: 99.9 %)"
    axes.set_ylabel(f"error against full physics, {label}", color=INK)
    axes.grid(color=LINE, linewidth=0.5, which="major")
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_ylim(bottom=bottom)
    axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(0, -0.12))
    figure.tight_layout()
    with atomic_write(path) as part:
        figure.savefig(part, dpi=120, format="png")


def _lines(axes: Any, floor: dict[str, float | None], cost: float | None, of: str) -> None:
    """Draws the limits of the error, and the cost of the reference. of: what limits the error."""
    if cost:
        axes.axvline(cost, color=INK, linewidth=1, linestyle="--")
        axes.annotate(
            "the reference's cost", (cost, 0.98), xycoords=("data", "axes fraction"), fontsize=8,
            rotation=90, va="top", ha="right", color=INK, xytext=(-3, 0),
            textcoords="offset points",
        )  # fmt: skip
    reference, chance = floor["reference"], floor["monte_carlo"]
    if reference:
        label = "the reference's own error"
        axes.axhline(reference, color=INK, linewidth=1, linestyle=":", label=label)
    if chance:
        axes.axhline(
            chance, color=MARK, linewidth=1, linestyle=":",
            label=f"Monte Carlo floor: {of}; without common random numbers <= CI below it",
        )  # fmt: skip
