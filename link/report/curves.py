"""The figure of a link's error rates: theory as lines, Monte Carlo trials as points with
intervals."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim.report.figures import INK, LINE, subplots

PANELS: Final = (
    ("poisson", "A tick that begins empty", "ON level, thresholds a tick"),
    ("reset", "What the reset rule keeps", "background, thresholds a tick"),
    ("fading", "On-off keying in noise and fading", "signal-to-noise ratio, dB"),
    ("words", "Words of RS(255,223)", "byte error rate"),
)
COLOURS: Final = ("#2f5fa8", "#d9480f", "#3a8f5c", "#7fa3d6", "#e8a07f", "#8cc4a1")
PLACES: Final = {"poisson": "upper right", "reset": (0.02, 0.44), "fading": "upper right",
          "words": "lower right"}  # fmt: skip
_FLOOR: Final = 1e-6


def draw_curves(document: dict[str, Any], path: Path) -> None:
    """Draws the document of `measure_curves` to a PNG or SVG."""
    figure, axes = subplots(2, 2, figsize=(12.5, 9.6))
    for (panel, title, label), ax in zip(PANELS, axes.ravel(), strict=True):
        curves = [c for c in document["curves"] if c["panel"] == panel]
        for curve, colour in zip(curves, COLOURS, strict=False):
            _curve(ax, curve, colour)
        ax.set_yscale("log")
        if panel == "reset":
            ax.set_xscale("log")
            ticks = [0.02, 0.05, 0.1, 0.2]
            ax.set_xticks(ticks, [f"{t:g}" for t in ticks])
            ax.minorticks_off()
        bottom = min((min(c["theory"]) for c in curves), default=_FLOOR)
        ax.set_ylim(max(bottom / 3, _FLOOR), 30 if panel == "fading" else 1)  # room for the legend
        ax.set_title(title, fontsize=11, color=INK, loc="left")
        ax.set_xlabel(label, fontsize=9, color=INK)
        words = any(c["trial"] == "codeword" for c in curves)
        ax.set_ylabel("word error rate" if words else "bit error rate", fontsize=9, color=INK)
        ax.grid(color=LINE, linewidth=0.5)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(colors=INK, labelsize=8.5)
        if curves:
            ax.legend(fontsize=7.5, frameon=False, loc=PLACES[panel])
    judged, level = document["points_judged"], document["level"]
    figure.suptitle(
        "Lines: theory. Points: Monte Carlo, filled from 100 errors on; bars: Clopper-Pearson, "
        f"all {judged} filled ones together at {level:.0%}",
        fontsize=10, color=INK, y=0.995,
    )  # fmt: skip
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def _curve(ax: Any, curve: dict[str, Any], colour: str) -> None:
    x, measured = np.array(curve["x"]), np.array(curve["measured"])
    low, high = np.array(curve["low"]), np.array(curve["high"])
    ax.plot(x, curve["theory"], color=colour, linewidth=1.4, label=curve["title"])
    if "beside" in curve:
        other = curve["beside"]
        ax.plot(
            x, other["theory"], color=INK, linewidth=1.2, linestyle=(0, (1, 3)), zorder=3,
            label=f"no interleaver, {other['name']}",
        )  # fmt: skip
    judged = np.array(curve["judged"])
    for chosen, fill in ((judged, colour), (~judged, "white")):
        drawn = chosen & (measured > 0)
        if drawn.any():
            ax.errorbar(
                x[drawn], measured[drawn], [(measured - low)[drawn], (high - measured)[drawn]],
                fmt="o", markersize=4, color=colour, markerfacecolor=fill, elinewidth=1, capsize=2,
            )  # fmt: skip
