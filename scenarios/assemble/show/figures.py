"""The figures in the sections of a display."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from cosim.report.figures import INK, LINE, MARK, subplots
from display.chain.outcome import SPIKE, DisplayOutcome
from display.chain.tap import panel_waves, spike_waves
from display.probes.latency import PARTS
from scenarios.assemble.show.shown import Shown

__all__ = ["latency_figure", "wave_figure"]

_COLOURS = ("#2f6db5", "#74a7dd", "#c8ccd4", "#f2b36b")
WINDOW = 25 * 10**9
"""Maximum length of the plotted window, ps."""
SAMPLES = 2000
"""Number of samples in the plotted window."""


def _places(levels: Any, waves: Any) -> list[int]:
    """Two of the recorded pixels: the one whose light changes most on all displays together, and
    the dimmest one with constant light above zero.

    Args:
        levels: true light, white = 1, (samples, pixels).
        waves: light of each display, of the same shape.
    """
    change = np.ptp(levels, axis=0)
    waving = sum(np.minimum(np.ptp(wave, axis=0), 1.0) for wave in waves)
    moving = int(np.argmax(np.where(change > 1e-3, waving, 0.0)))
    still = [n for n in np.argsort(levels.mean(axis=0)) if change[n] < 1e-3 and levels[0, n] > 0]
    return list(dict.fromkeys([moving, *(int(n) for n in still[:1])]))


def wave_figure(shown: Shown, path: Path) -> str:
    """Writes the light of two pixels over time on every display, with the true light; returns the
    caption."""
    outcome, clock = shown.outcome, shown.clock
    chain, end = outcome.chain, clock.edge(shown.stream.cycles)
    assert chain.tap is not None
    first = max(end // 2 - WINDOW // 2, 0)
    at = np.linspace(first, min(first + WINDOW, end) - 1, SAMPLES).astype(np.int64)
    ms, light = at / 1e9, chain.tap.light()
    truth = np.array([light.at(int(t))[0] for t in at])
    starts, spikes = spike_waves(
        shown.stream, chain.panel, [p[:2] for p in chain.points], int(at[-1])
    )
    plane = np.clip(np.searchsorted(starts, at, "right") - 1, 0, len(spikes) - 1)
    waves = {SPIKE: np.where(at[:, None] >= starts[0], spikes[plane], 0.0)}
    for panel in chain.section.reference_panels():
        waves[panel.name] = panel_waves(panel, light, at)
    places = _places(truth, waves.values())
    figure, axes = subplots(
        len(waves), len(places), sharex=True, squeeze=False,
        figsize=(5.6 * len(places), 0.95 * len(waves) + 0.9),
    )  # fmt: skip
    for row, (name, wave) in zip(axes, waves.items(), strict=True):
        for place, ax in zip(places, row, strict=True):
            ax.fill_between(ms, wave[:, place], step="mid", color="#9db4d8", linewidth=0)
            ax.plot(ms, truth[:, place], color=MARK, linewidth=1)
            top = max(float(truth[:, place].max()) * 2.2, 1e-3)
            ax.set_ylim(0, top)
            ax.set_yticks([0, float(f"{top / 2.2:.2g}")])
            ax.tick_params(labelsize=7, color=LINE, labelcolor=INK)
            ax.spines[["top", "right"]].set_visible(False)
            ax.spines[["left", "bottom"]].set_color(LINE)
        row[0].set_ylabel(
            outcome.title(name), rotation=0, ha="right", va="center", fontsize=8.5, color=INK
        )
        row[0].yaxis.set_label_coords(-0.12, 0.5)
    for place, ax in zip(places, axes[0], strict=True):
        row_of, column, label = chain.points[place]
        ax.set_title(f"{label} (row {row_of}, column {column})", fontsize=9.5, color=INK)
    for ax in axes[-1]:
        ax.set_xlabel("time (ms)", fontsize=9, color=INK)
        ax.set_xlim(ms[0], ms[-1])
    figure.tight_layout(h_pad=0.2)
    figure.savefig(path, dpi=110)
    return (
        "Light that each display emits at two pixels of the image (blue) and the true light there "
        "(line), white = 1. Values above the frame are cut off."
    )


def latency_figure(outcome: DisplayOutcome, path: Path) -> None:
    """Writes the latencies by stage, for a step out of the dark: one plot for each light, one bar
    for each display."""
    from matplotlib.patches import Rectangle

    assert outcome.probes is not None
    rows_on = [row for row in outcome.probes.latency if row.way == "rise"]
    rates = list(dict.fromkeys(row.rate for row in rows_on))
    figure, axes = subplots(1, len(rates), figsize=(2.6 * len(rates) + 1.2, 3.4), sharey=True)
    for rate, ax in zip(rates, np.atleast_1d(axes), strict=True):
        rows = [row for row in rows_on if row.rate == rate][::-1]
        highs = [row.total.high for row in rows if row.drive and math.isfinite(row.total.high)]
        most = 1.1 * max(highs, default=1e3) / 1e3
        for y, row in enumerate(rows):
            left = 0.0
            for part, colour in zip(row.parts, _COLOURS, strict=True):
                ms = max(part.mean / 1e3, 0.0)
                ax.barh(y, ms, left=left, color=colour, height=0.62, linewidth=0)
                left += ms
            middle, ends = row.total.median / 1e3, (row.total.low / 1e3, row.total.high / 1e3)
            ax.plot(ends, (y, y), color=INK, linewidth=1, solid_capstyle="butt")
            ax.plot(middle, y, "|", color=MARK, markersize=10, markeredgewidth=2)
            if middle > most:
                place = {"ha": "right", "va": "center", "fontsize": 8, "color": INK}
                box = {"facecolor": "white", "edgecolor": "none", "pad": 1}
                ax.text(most * 0.97, y, f"{middle:.3g} ms ›", bbox=box, **place)
        names = [f"spikes, {row.drive}" if row.drive else row.display for row in rows]
        ax.set_yticks(range(len(rows)), names, fontsize=8.5, color=INK)
        ax.set_xlim(0, most)
        ax.set_title(f"{rate:g} spikes a cycle", fontsize=9.5, color=INK)
        ax.set_xlabel("ms", fontsize=8.5, color=INK)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(color=LINE, labelcolor=INK, labelsize=8)
    handles = [Rectangle((0, 0), 1, 1, color=colour) for colour in _COLOURS]
    figure.legend(handles, PARTS, loc="lower center", ncols=4, frameon=False, fontsize=8.5)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    figure.savefig(path, dpi=110)
