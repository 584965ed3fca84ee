"""The figures in the sections of a display."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cosim.report.drawn import Data, Value, write_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from display.chain.outcome import SPIKE, DisplayOutcome
from display.chain.tap import panel_waves, spike_waves
from display.probes.latency import PARTS
from display.report.shown import Shown

_COLOURS = ("#2f6db5", "#74a7dd", "#c8ccd4", "#f2b36b")
WINDOW = 25 * 10**9
"""Maximum length of the plotted window, ps."""
SAMPLES = 2000
"""Number of samples in the plotted window."""
_ROOM, _HIGH = 2.2, 0.9
"""Height of a wave's frame, in true levels; its share of the distance between two frames."""
_FRAME: Any = {"color": LINE, "linewidth": 0.8, "clip_on": False}
_LABEL = {"facecolor": "white", "edgecolor": "none", "pad": 1}
_BAR = 0.62
"""Height of a bar, in distances between two bars."""


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


def _named(point: tuple[int, int, str]) -> tuple[str, str]:
    """Place and title of a pixel of interest, (row, column, label). The label of a scene without
    named parts is the place itself."""
    row, column, label = point
    place = f"row {row}, column {column}"
    return place, label if label == place else f"{label} ({place})"


def wave_figure(shown: Shown, path: Path) -> tuple[str, Data]:
    """Writes the light of two pixels over time on every display, with the true light; returns the
    caption and what was drawn."""
    outcome, clock = shown.outcome, shown.clock
    chain, end = outcome.chain, clock.edge(shown.stream.cycles)
    assert chain.tap is not None
    first = max(end // 2 - WINDOW // 2, 0)
    at = np.linspace(first, min(first + WINDOW, end) - 1, SAMPLES).astype(np.int64)
    ms, light = at / 1e9, chain.tap.light()
    truth = np.array([light.at(int(t))[0] for t in at])
    starts, spikes = spike_waves(
        shown.stream, chain.panel, [p[:2] for p in chain.points], int(at[-1]),
        chain.panel_stage.told,
    )  # fmt: skip
    plane = np.clip(np.searchsorted(starts, at, "right") - 1, 0, len(spikes) - 1)
    waves = {SPIKE: np.where(at[:, None] >= starts[0], spikes[plane], 0.0)}
    for panel in chain.section.reference_panels():
        waves[panel.name] = panel_waves(panel, light, at)
    places = _places(truth, waves.values())
    size = 5.6 * len(places) + 0.3, 0.95 * len(waves) + 0.9
    figure, axes = subplots(1, len(places), squeeze=False, figsize=size)
    bases = np.arange(len(waves))[::-1]
    rows_of: list[tuple[Value, ...]] = []
    # One pair of axes a pixel: each further one takes as long as all that is drawn in it.
    for place, ax in zip(places, axes[0], strict=True):
        level = max(float(truth[:, place].max()), 1e-3 / _ROOM)
        scale = _HIGH / (_ROOM * level)
        for base, wave in zip(bases, waves.values(), strict=True):
            shown_wave = base + np.minimum(scale * wave[:, place], _HIGH)
            ax.fill_between(ms, base, shown_wave, step="mid", color="#9db4d8", linewidth=0)
            ax.plot(ms, base + scale * truth[:, place], color=MARK, linewidth=1)
        ax.vlines([ms[0]] * len(bases), bases, bases + _HIGH, **_FRAME)
        ax.hlines(bases, ms[0], ms[-1], **_FRAME)
        ax.spines[:].set_visible(False)
        ticks = np.stack([bases, bases + scale * level]).T.ravel()
        ax.set_yticks(ticks, ["0", f"{level:.2g}"] * len(bases), fontsize=7)
        ax.set_xlim(ms[0], ms[-1])
        ax.set_ylim(0, len(waves) - 1 + _HIGH)
        ax.tick_params(labelsize=7, color=LINE, labelcolor=INK)
        pixel, title = _named(chain.points[place])
        lights = {"true light": truth} | {outcome.title(n): wave for n, wave in waves.items()}
        for name, light_of in lights.items():
            level_of = light_of[:, place]
            turns = np.flatnonzero(np.diff(level_of))
            ends = np.unique(np.concatenate([[0], turns, turns + 1, [len(ms) - 1]]))
            # only where the light changes
            rows_of += [(pixel, name, float(ms[k]), float(level_of[k])) for k in ends]
        ax.set_title(title, fontsize=9.5, color=INK)
        ax.set_xlabel("time (ms)", fontsize=9, color=INK)
    across = axes[0, 0].get_yaxis_transform()
    for base, name in zip(bases, waves, strict=True):
        axes[0, 0].text(
            -0.1, base + _HIGH / 2, outcome.title(name), ha="right", va="center", fontsize=8.5,
            color=INK, transform=across,
        )  # fmt: skip
    wide, tall = size
    figure.subplots_adjust(
        1.5 / wide, 0.5 / tall, 1 - 0.1 / wide, 1 - 0.35 / tall, wspace=0.12
    )  # fmt: skip
    write_figure(figure, path)
    return (
        "Light that each display emits at two pixels of the image (blue) and the true light there "
        "(line), white = 1. Values above the frame are cut off.",
        Data(("pixel", "display", "time, ms", "light, white = 1"), rows_of),
    )


def latency_figure(outcome: DisplayOutcome, path: Path) -> Data:
    """Writes the latencies by stage, for a step out of the dark: one plot for each light, one bar
    for each display. Returns what was drawn, ms."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Rectangle

    assert outcome.probes is not None
    rows_on = [row for row in outcome.probes.latency if row.way == "rise"]
    rates = list(dict.fromkeys(row.rate for row in rows_on))
    size = 2.6 * len(rates) + 1.2, 3.4
    figure, axes = subplots(1, len(rates), figsize=size, squeeze=False)
    rows_of: list[tuple[Value, ...]] = []
    for rate, ax in zip(rates, axes[0], strict=True):
        rows = [row for row in rows_on if row.rate == rate][::-1]
        places = np.arange(len(rows))
        parts = np.array([[max(part.mean / 1e3, 0.0) for part in row.parts] for row in rows])
        ends = np.cumsum(parts, axis=1)
        for begin, end, colour in zip((ends - parts).T, ends.T, _COLOURS, strict=True):
            low, high = places - _BAR / 2, places + _BAR / 2
            corners = [(begin, low), (end, low), (end, high), (begin, high)]
            bars = np.stack([np.stack(corner, -1) for corner in corners], 1)
            ax.add_collection(PolyCollection(list(bars), facecolors=colour), autolim=False)
        lows, medians, highs = (
            np.array([getattr(row.total, name) for row in rows]) / 1e3
            for name in ("low", "median", "high")
        )
        rows_of += [
            (f"spikes, {row.drive}" if row.drive else row.display, float(rate),
             *(float(x) for x in (*part, low, median, high)))
            for row, part, low, median, high in zip(
                rows[::-1], parts[::-1], lows[::-1], medians[::-1], highs[::-1], strict=True)
        ]  # fmt: skip
        spiking = np.array([bool(row.drive) for row in rows]) & np.isfinite(highs)
        most = 1.1 * float(highs[spiking].max(initial=0.0)) or 1.1
        ax.hlines(places, lows, highs, color=INK, linewidth=1)
        ax.plot(medians, places, "|", color=MARK, markersize=10, markeredgewidth=2)
        for y, middle in zip(places, medians, strict=True):
            if middle > most:
                ax.text(most * 0.97, y, f"{middle:.3g} ms ›", ha="right", va="center", fontsize=8,
                        color=INK, bbox=_LABEL)  # fmt: skip
        names = [f"spikes, {row.drive}" if row.drive else row.display for row in rows]
        ax.set_yticks(places, names if ax is axes[0, 0] else [], fontsize=8.5, color=INK)
        ax.set_ylim(-0.7, len(rows) - 0.3)
        ax.set_xlim(0, most)
        ax.set_title(f"{rate:g} spikes a cycle", fontsize=9.5, color=INK)
        ax.set_xlabel("ms", fontsize=8.5, color=INK)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(color=LINE, labelcolor=INK, labelsize=8)
    handles = [Rectangle((0, 0), 1, 1, color=colour) for colour in _COLOURS]
    figure.legend(handles, PARTS, loc="lower center", ncols=4, frameon=False, fontsize=8.5)
    wide, tall = size
    figure.subplots_adjust(1.25 / wide, 0.75 / tall, 1 - 0.15 / wide, 1 - 0.35 / tall, wspace=0.12)
    write_figure(figure, path)
    ends_of = ("5 % of the total, ms", "median, ms", "95 %, ms")
    head = ("display", "light, spikes/cycle", *(f"{part}, mean, ms" for part in PARTS), *ends_of)
    return Data(head, rows_of)
