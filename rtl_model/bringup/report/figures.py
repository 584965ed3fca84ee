"""Figures of a bring-up: captured and expected planes, wrong bits, threshold sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cosim.config.amounts import count
from cosim.report.drawn import Data, Value, write_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from rtl_model.bringup.bench.bench import Burst

_MAPPED = 1500
"""Pixels of all bursts up to which the data of the figure hold all, not the wrong ones alone."""
_RULES = {"residual": "#1c7ed6", "hard": "#2b8a3e", "subtract": "#9c36b5"}


def planes_figure(bursts: list[Burst], path: Path) -> Data:
    """Draws one row for each burst: expected spike counts, captured spike counts, wrong bits.

    All three are summed over the frames for each pixel. The first wrong bit is circled.
    """
    figure, rows = subplots(
        len(bursts), 3, figsize=(9.5, 2.9 * len(bursts)), squeeze=False, layout="constrained"
    )
    found: list[tuple[Value, ...]] = []
    for axes, burst in zip(rows, bursts, strict=True):
        expected, captured = burst.expected.sum(axis=0), burst.got.sum(axis=0)
        wrong = (burst.expected != burst.got).sum(axis=0)
        frames = len(burst.got)
        few = sum(each.got[0].size for each in bursts) <= _MAPPED
        places = np.nonzero(np.ones_like(wrong) if few else wrong)
        found += [
            (burst.name, float(row), float(column),
             *(float(each[row, column]) for each in (expected, captured, wrong)))
            for row, column in zip(*places, strict=True)
        ]  # fmt: skip
        title = "no wrong bit" if burst.wrong is None else f"{count(burst.wrong.bits)} wrong bits"
        for place, plane, text in (
            (axes[0], expected, f"{burst.name}: expected"),
            (axes[1], captured, f"captured, {frames} frames"),
        ):
            image = place.imshow(plane, cmap="gray", vmin=0, vmax=frames, interpolation="nearest")
            place.set_title(text, fontsize=10, color=INK)
        figure.colorbar(image, ax=axes[1], shrink=0.8, label="spikes")
        axes[2].imshow(np.zeros_like(wrong), cmap="gray_r", vmin=0, vmax=1)
        masked = np.ma.masked_equal(wrong, 0)
        axes[2].imshow(masked, cmap="autumn_r", vmin=0, vmax=frames, interpolation="nearest")
        axes[2].set_title(title, fontsize=10, color=MARK if burst.wrong else INK)
        if burst.wrong is not None:
            axes[2].plot(
                burst.wrong.column, burst.wrong.row, "o", markersize=16, markerfacecolor="none",
                markeredgecolor=INK, markeredgewidth=1.2,
            )  # fmt: skip
        for place in axes:
            place.set_xlabel("column", fontsize=8, color=INK)
            place.set_ylabel("row", fontsize=8, color=INK)
            place.tick_params(labelsize=8)
            place.spines[:].set_color(LINE)
    write_figure(figure, path, 120)
    head = ("burst", "row", "column", "spikes expected", "spikes captured", "wrong bits")
    return Data(head, found)


def threshold_figure(rates: list[dict[str, Any]], path: Path) -> Data:
    """Draws spikes per pixel and tick against threshold level, one panel for each clock.

    Lines are the closed form, points the board's counts. A row of `rates` holds `clock` (0 or 1),
    `rule`, `level`, `rate` and `expected`.
    """
    figure, places = subplots(1, 2, figsize=(9.5, 3.6), sharey=True, layout="constrained")
    for select, axes in enumerate(places):
        for rule, colour in _RULES.items():
            rows = [r for r in rates if r["clock"] == select and r["rule"] == rule]
            levels = [r["level"] for r in rows]
            shift = 0.12 * (list(_RULES).index(rule) - 1)  # keeps coinciding points apart
            axes.plot(levels, [r["expected"] for r in rows], color=colour, linewidth=1)
            axes.plot(
                [level + shift for level in levels], [r["rate"] for r in rows], "o", color=colour,
                markersize=4, label=rule,
            )  # fmt: skip
        axes.set_title(f"{20 if select else 40} kHz", fontsize=11, color=INK)
        axes.set_xlabel("threshold level", color=INK)
        axes.grid(color=LINE, linewidth=0.5)
        axes.spines[["top", "right"]].set_visible(False)
    places[0].set_ylabel("spikes a pixel and tick", color=INK)
    places[1].legend(fontsize=9, frameon=False)
    write_figure(figure, path, 120)
    return Data(
        ("rule", "clock, kHz", "threshold level", "spikes/tick, closed form", "spikes/tick, board"),
        [
            (r["rule"], 20.0 if r["clock"] else 40.0, r["level"], r["expected"], r["rate"])
            for r in rates
        ],
    )
