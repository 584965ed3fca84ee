"""The figures of a link's error rates and of its capacity."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim.report.figures import INK, LINE, MARK, subplots
from link.report.figures import BLUE, bits

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
_GREY: Final = "#7a8294"
_LABELS: Final = {
    "distance": "distance, m", "luminance": "luminance, cd/m²", "ambient": "illuminance, lux",
    "cell": "side of a cell, panel pixels",
}  # fmt: skip
_LEAST: Final = 1e-3
"""Smallest rate drawn, over the largest."""


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


def draw_capacity(curves: list[dict[str, Any]], path: Path) -> None:
    """Draws the curves of `CapacityStudy` to a PNG or SVG, four at most."""
    figure, axes = subplots(2, 2, figsize=(12.5, 9.2), layout="constrained")
    top = max(max(curve["capacity_bps"]) for curve in curves)
    for curve, ax in zip(curves, axes.ravel(), strict=False):
        _capacity_curve(ax, curve, top * _LEAST / 2)
        ax.set_yscale("log")
        ax.set_ylim(top * _LEAST, top * 2)
        ax.yaxis.set_major_formatter(lambda rate, _: bits(rate))
    axes[0, 0].legend(fontsize=8.5, frameon=False, loc="lower left")
    figure.suptitle(
        "Bound: every camera pixel, one bit a tick at most. Information: random data on a strip of "
        "the panel, by the detector's soft values; bars: 99.9 %.\n"
        "Numbers: cell of the best mode and ticks of its symbols. Upright lines: the scenario's "
        "own value; of distance, the range in which a receiver finds the panel.",
        fontsize=9.5, color=INK,
    )  # fmt: skip
    figure.savefig(path, dpi=110)


def _capacity_curve(ax: Any, curve: dict[str, Any], floor: float) -> None:
    x = np.array(curve["x"])
    ax.plot(x, curve["capacity_bps"], color=_GREY, linewidth=1.3, linestyle="--", label="bound")
    for name, colour, marker, label in (
        ("best", MARK, "s", "information of the best mode"),
        ("information", BLUE, "o", "information of the given mode"),
    ):
        rate, low, high = (
            np.array(curve[f"{name}_{part}"], np.float64) for part in ("bps", "low", "high")
        )
        known = np.isfinite(rate)
        if known.any():
            rate, low, high = (np.maximum(each[known], floor) for each in (rate, low, high))
            ax.errorbar(
                x[known], rate, [rate - low, high - rate], color=colour, marker=marker,
                markersize=4.5, linewidth=1.3, capsize=2.5, label=label,
            )  # fmt: skip
    for at, rate, mode in zip(x, curve["best_bps"], curve["best_mode"], strict=True):
        if mode is not None and rate > 2 * floor:
            ax.annotate(
                f"{mode['cell']}×{mode['cell']}, {mode['ticks']}", (at, rate), (0, 7),
                fontsize=8, color=MARK,
                textcoords="offset points", ha="center",
            )  # fmt: skip
    for mark in curve["marks"]:
        ax.axvline(mark, color=LINE, linewidth=1, zorder=0)
    ax.set_xscale("log")
    ticks = x if len(x) <= 8 else x[:: -(-len(x) // 8)]
    ax.set_xticks(ticks, [_short(value) for value in ticks])
    ax.minorticks_off()
    ax.set_title(curve["title"][0].upper() + curve["title"][1:], fontsize=11, color=INK, loc="left")
    ax.set_xlabel(_LABELS[curve["name"]], fontsize=9, color=INK)
    ax.grid(color=LINE, linewidth=0.4, axis="y")
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(LINE)
    ax.tick_params(colors=INK, labelsize=8.5)


def _short(value: float) -> str:
    """Text of a value: three digits, thousands as k."""
    return f"{value / 1000:.3g}k" if value >= 1000 else f"{value:.3g}"
