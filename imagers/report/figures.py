"""Tools for the figures of imagers: axes, saving, and waveforms of a sequencer from its trace."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.report.figures import INK, LINE

BLUE, GREEN, VIOLET = "#1c7ed6", "#2b8a3e", "#9c36b5"
Changes = list[tuple[int, int]]
"""(instant in ps, value) of each change of a signal, in order of time."""


def style_axes(axes: Any, x: str = "", y: str = "") -> None:
    """Sets labels and a light grid, and removes the box."""
    axes.set_xlabel(x, color=INK, fontsize=9)
    axes.set_ylabel(y, color=INK, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(color=LINE, linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)


def stretch(values: npt.NDArray[Any], low: float, high: float) -> npt.NDArray[np.float64]:
    """Maps values from [low, high] to [0, 1], clipped."""
    return np.clip((values.astype(np.float64) - low) / max(high - low, 1e-12), 0, 1)


def read_vcd(path: Path) -> dict[str, Changes]:
    """Changes of every signal of a VCD written by `device.trace`, by its local name."""
    names: dict[str, str] = {}
    changes: dict[str, Changes] = {}
    now = 0
    with path.open(encoding="ascii") as file:
        for line in file:
            words = line.split()
            if not words:
                continue
            if words[0] == "$var":
                names[words[3]] = words[4]
                changes[words[4]] = []
            elif line[0] == "#":
                now = int(line[1:])
            elif line[0] in "01":
                changes[names[words[0][1:]]].append((now, int(line[0])))
            elif line[0] == "b":
                changes[names[words[1]]].append((now, int(words[0][1:], 2)))
    return changes


def waveforms(
    axes: Any,
    signals: dict[str, Changes],
    names: Sequence[str],
    span: tuple[int, int],
    unit: float = 1e9,
) -> None:
    """Draws signals below one another; they are not among the data of the figure. A signal with too
    many edges to resolve becomes a band.

    Args:
        axes: axes of matplotlib.
        signals: changes by name.
        names: signals to draw, from the top.
        span: first and last instant, ps.
        unit: unit of the time axis, ps.
    """
    for row, name in enumerate(names):
        base = len(names) - 1 - row
        changes = signals.get(name, [])
        before = [value for ps, value in changes if ps <= span[0]]
        inside = [(ps, value) for ps, value in changes if span[0] < ps < span[1]]
        points = [(span[0], before[-1] if before else 0), *inside]
        top = max([value for _, value in changes] or [1]) or 1
        x = np.array([ps for ps, _ in points] + [span[1]]) / unit
        y = np.array([value for _, value in points] + [points[-1][1]]) / top
        if len(points) > 4000:
            x, y = _thinned(x, y)
        axes.step(x, base + 0.72 * y, where="post", color=INK, linewidth=0.8, label="_nolegend_")
        axes.fill_between(
            x, base, base + 0.72 * y, step="post", color=BLUE, alpha=0.18, linewidth=0
        )
    axes.set_yticks([n + 0.3 for n in range(len(names))], list(names)[::-1], fontsize=8)
    axes.set_xlim(span[0] / unit, span[1] / unit)
    axes.set_ylim(-0.2, len(names))
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.grid(axis="x", color=LINE, linewidth=0.5)


def _thinned(x: Any, y: Any) -> tuple[Any, Any]:
    """Reduces steps to the resolution of a figure: the smallest and largest value of each bin."""
    edges = np.linspace(x[0], x[-1], 1200)
    at = np.clip(np.searchsorted(edges, x) - 1, 0, 1198)
    high, low = np.zeros(1199), np.ones(1199)
    np.maximum.at(high, at, y)
    np.minimum.at(low, at, y)
    filled = np.bincount(at, minlength=1199) > 0
    last = np.zeros(1199)
    last[at] = y
    carried = last[np.maximum.accumulate(np.where(filled, np.arange(1199), 0))]
    high, low = np.where(filled, high, carried), np.where(filled, low, carried)
    return np.repeat(edges[:-1], 2), np.stack([low, high], axis=1).reshape(-1)
