"""The figure of a sweep: metrics over the keys that vary."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.report.figures import INK, MARK, subplots
from scenarios.studies.batch.axes import Axis
from scenarios.studies.sweep.store import Row, metric_values

_SHOWN: Final = 4
"""Metrics of a figure that nobody chose."""
_ASKED_FOR: Final = ("psnr", "goodput_bps", "ber", "error")
"""Ends of the names of metrics that are drawn before others."""
_OF_THE_RUN: Final = ("run_time_s", "camera", "full_physics", "error_high")
"""Figures that are not drawn unasked."""


def chosen(values: dict[str, Any], metrics: Sequence[str]) -> list[str]:
    """Names of the metrics in the figure: those asked for, or those that vary most. Raises
    InputError for a name that no result has."""
    for name in metrics:
        if values and name not in values:
            raise InputError("--metric", f"one of {', '.join(values)}", name, "choose one")
    if metrics:
        return [name for name in metrics if name in values]
    spread = {
        name: float(np.nanstd(v) / (abs(np.nanmean(v)) or 1))
        for name, (v, _) in values.items()
        if name not in _OF_THE_RUN and np.isfinite(v).any()
    }
    varied = [name for name in spread if spread[name] > 0] or list(spread)
    varied.sort(key=lambda name: (not name.endswith(_ASKED_FOR), -spread[name]))
    return varied[:_SHOWN]


def sweep_figure(
    path: Path, axes: Sequence[Axis], points: Sequence[tuple[str, ...]], rows: Sequence[Row],
    metrics: Sequence[str] = (),
) -> list[str]:  # fmt: skip
    """Draws a panel for each metric: a line over one key, a map over two of a grid, else points
    over each key. Returns the names of the metrics.

    Raises:
        InputError: no such metric.
    """
    values = metric_values(rows)
    names = chosen(values, metrics)
    if not names:
        return []
    shape = [len(axis.texts) for axis in axes]
    whole = int(np.prod(shape)) == len(points)
    across = 1 if whole and len(axes) <= 2 else len(axes)
    figure, panels = subplots(
        len(names), across, figsize=(1.5 + 4.2 * across, 3.2 * len(names)), layout="constrained",
        squeeze=False,
    )  # fmt: skip
    for line, name in zip(panels, names, strict=True):
        level, unit = values[name]
        label = name if unit == "1" else f"{name} ({unit})"
        if whole and len(axes) == 2:
            _map(figure, line[0], axes, level.reshape(shape), label)
            continue
        for n, (panel, axis) in enumerate(zip(line, axes, strict=False)):
            at, ticks = _places(axis, [point[n] for point in points])
            style = "o-" if whole and len(axes) == 1 else "o"
            panel.plot(at, level, style, color=MARK, markersize=4)
            panel.set_xlabel(axis.key + (f" ({axis.unit})" if axis.unit else ""))
            panel.set_ylabel(label)
            _scale(panel.xaxis, axis, ticks)
            panel.grid(alpha=0.3)
    figure.savefig(path, dpi=120, facecolor="white")
    return names


def _places(axis: Axis, texts: Sequence[str]) -> tuple[npt.NDArray[np.float64], list[str] | None]:
    """Places of values on an axis, and labels if they are no numbers."""
    numbers = Axis(axis.key, tuple(texts), axis.span, axis.unit).numbers
    if numbers is not None:
        return np.array(numbers), None
    known = list(axis.texts or dict.fromkeys(texts))
    return np.array([known.index(text) for text in texts], np.float64), known


def _scale(side: Any, axis: Axis, ticks: list[str] | None) -> None:
    if ticks is not None:
        side.set_ticks(range(len(ticks)), ticks)
    elif axis.log:
        side._set_axes_scale("log")


def _map(
    figure: Any, panel: Any, axes: Sequence[Axis], level: npt.NDArray[np.float64], label: str
) -> None:
    """A map over two keys, each value in a cell of its own."""
    image = panel.imshow(level, origin="lower", aspect="auto", cmap="viridis")
    for side, axis in ((panel.yaxis, axes[0]), (panel.xaxis, axes[1])):
        side.set_ticks(range(len(axis.texts)), axis.texts)
        side.set_label_text(axis.key, color=INK)
    panel.tick_params(axis="x", rotation=30)
    figure.colorbar(image, ax=panel, label=label)
