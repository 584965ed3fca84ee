"""Interval histograms of recordings and model, as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from cosim.report.drawn import Data, Value, write_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from sensor.calibrate.histograms import Histogram

_BLUE: Final = "#2f5fa8"
_SHOWN: Final = 1e-7
"""Least share of the intervals that the axis shows."""


def intervals_figure(histograms: tuple[Histogram, ...], path: Path) -> Data:
    """Draws a column for each recording: above the shares of intervals, logarithmic, bars for the
    recording and dots for the model; below the difference over the share.

    Args:
        histograms: one or more.
        path: path of the PNG file.

    Returns:
        What was drawn: the intervals of recording and model, and how many of them.
    """
    wide = len(histograms)
    figure, axes = subplots(
        2, wide, figsize=(max(4.4 * wide, 5.4), 5.2), layout="constrained", squeeze=False,
        height_ratios=[2.2, 1],
    )  # fmt: skip
    rows: list[tuple[Value, ...]] = []
    for column, each in enumerate(histograms):
        total = each.measured.sum()
        shares, model = each.measured / total, each.model / total
        seen = np.flatnonzero(np.maximum(shares, model)[:-1] > _SHOWN)
        first, last = int(seen[0]), int(seen[-1]) + 1
        cycles = np.arange(first + 1, last + 1)
        rows += [
            (Path(each.name).name, float(n), float(each.measured[n - 1]), float(each.model[n - 1]))
            for n in cycles
        ]
        top, below = axes[:, column]
        top.bar(cycles, shares[first:last], width=0.85, color=_BLUE, alpha=0.55, label="recording")
        top.plot(cycles, model[first:last], "o", color=MARK, markersize=4, label="model")
        top.set_yscale("log")
        top.set_ylim(_SHOWN, 2)
        chance = f"p = {each.chance:.2g}" if each.chance > 1e-4 else "p < 0.0001"
        top.set_title(
            f"{Path(each.name).name}, {each.rate:.3g} spikes a cycle\nchi-square "
            f"{each.chi_square:.1f} for {each.bins} bins, {chance}", fontsize=9, color=INK,
        )  # fmt: skip
        error = 3 * np.sqrt(np.maximum(model[first:last], _SHOWN) / total)
        below.fill_between(cycles, -error * 1e2, error * 1e2, color=LINE, step="mid",
                           label="3 sqrt(count)")  # fmt: skip
        below.plot(cycles, (shares - model)[first:last] * 1e2, "o", color=MARK, markersize=3)
        below.axhline(0, color=INK, linewidth=0.6)
        below.set_xlabel("interval, cycles", fontsize=9, color=INK)
        for ax in (top, below):
            ax.spines[["top", "right"]].set_visible(False)
            ax.spines[["left", "bottom"]].set_color(LINE)
            ax.tick_params(colors=INK, labelsize=8)
            ax.xaxis.get_major_locator().set_params(integer=True)
            ax.set_xlim(first + 0.4, last + 0.6)
    axes[0, 0].set_ylabel("share of intervals", fontsize=9, color=INK)
    axes[1, 0].set_ylabel("recording less model, %", fontsize=9, color=INK)
    for row in axes[:, 0]:
        row.legend(fontsize=8, frameon=False)
    write_figure(figure, path)
    return Data(("recording", "interval, cycles", "intervals", "intervals of the model"), rows)
