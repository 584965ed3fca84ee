"""The data of a figure: read from what Matplotlib has drawn, or given; written as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim.files.atomic import atomic_write

LARGEST: Final = 48_000
"""Length of the CSV of a figure from which on points are left out, characters."""
_CELLS: Final = 5_000
"""Cells of a drawn map from which on it is a picture, not data."""
_QUICK: Final = {"compress_level": 1}
"""How Pillow encodes figures: a quarter larger than by default, in a third of the time."""
Value = float | str | None
"""A cell."""


@dataclass(frozen=True)
class Data:
    """A table of numbers. Columns of text come first, and name the curve of a row.

    Attributes:
        head: names of the columns, with units.
        rows: the values; NaN and None are unknown.
    """

    head: tuple[str, ...]
    rows: list[tuple[Value, ...]]

    def csv(self) -> tuple[str, int]:
        """The table as CSV (RFC 4180), numbers to six digits; and n, if it has only every n-th
        point of each curve because the whole would be longer than LARGEST."""
        text = _csv(self.head, self.rows)
        every = -(-len(text) // LARGEST)
        return (text, 1) if every <= 1 else (_csv(self.head, self._thinned(every)), every)

    def _thinned(self, every: int) -> list[tuple[Value, ...]]:
        seen: dict[tuple[Value, ...], int] = {}
        kept = []
        for row in self.rows:
            curve = tuple(value for value in row if isinstance(value, str))
            number = seen.get(curve, 0)
            seen[curve] = number + 1
            if number % every == 0:
                kept.append(row)
        return kept


def _csv(head: Sequence[str], rows: Sequence[Sequence[Value]]) -> str:
    def cell(value: Value) -> str:
        if value is None or value != value:
            return ""
        return value if isinstance(value, str) else f"{value:.6g}"

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(head)
    writer.writerows([cell(value) for value in row] for row in rows)
    return text.getvalue()


def write_figure(figure: Any, path: Path, dpi: int = 110, **options: Any) -> None:
    """Writes a Matplotlib figure as PNG; the file appears under its name when it is complete.
    options: of `Figure.savefig`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as part:
        figure.savefig(part, dpi=dpi, format="png", pil_kwargs=_QUICK, **options)


def save_figure(figure: Any, path: Path) -> Data:
    """Writes a figure, and returns the data that it shows."""
    write_figure(figure, path)
    return drawn(figure)


def drawn(figure: Any) -> Data:
    """What a figure shows: points of lines with their error bars, bars, steps, dots, small maps.

    Lines across a whole axis, areas and text are guides, not data. A column `panel` tells the axes
    apart if there are several.
    """
    axes = [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]
    found: list[tuple[str, str, tuple[Value, ...]]] = []
    below = next((ax.get_xlabel() for ax in reversed(axes) if ax.get_xlabel()), "x")
    for n, ax in enumerate(axes, 1):
        panel = ", ".join(t for t in (_plain(ax.get_title()), _plain(ax.get_ylabel())) if t)
        for curve, row in _rows(ax):
            found.append((panel or f"panel {n}", curve, row))
    sides = {_plain(ax.get_ylabel()) for ax in axes} - {""}
    side = sides.pop() if len(sides) == 1 else "y"
    head = ["panel", "curve", _plain(below), side, "low", "high"]
    rows: list[tuple[Value, ...]] = [(panel, curve, *row) for panel, curve, row in found]
    used = [
        n for n in range(len(head))
        if n in (2, 3) or len({row[n] for row in rows}) > 1
    ]  # fmt: skip
    return Data(tuple(head[n] for n in used), [tuple(row[n] for n in used) for row in rows])


def _plain(text: str) -> str:
    return " ".join(text.replace("$", "").split())


def _rows(ax: Any) -> Iterator[tuple[str, tuple[Value, ...]]]:
    """(curve, (x, y, low, high)) of every point of one pair of axes."""
    from matplotlib.collections import PathCollection
    from matplotlib.container import BarContainer, ErrorbarContainer
    from matplotlib.patches import StepPatch

    spans: dict[Any, list[tuple[Value, Value]]] = {}
    for container in ax.containers:
        if isinstance(container, ErrorbarContainer) and container.has_yerr and container[0]:
            # Matplotlib gives no ends of a bar whose value or error is unknown.
            spans[container[0]] = [
                (float(s[0][1]), float(s[-1][1])) if len(s) else (None, None)
                for s in container[2][-1].get_segments()
            ]
    names = {c[0]: str(c.get_label()) for c in ax.containers if isinstance(c, ErrorbarContainer)}
    for n, line in enumerate(ax.lines, 1):
        across = line.get_transform() != ax.transData
        hidden = line not in names and line.get_label() == "_nolegend_"
        if across or hidden:  # a guide; the caps of an error bar
            continue
        name, bars = names.get(line, str(line.get_label())), spans.get(line)
        for k, (x, y) in enumerate(zip(line.get_xdata(), line.get_ydata(), strict=True)):
            yield _named(name, n), (float(x), float(y), *(bars[k] if bars else (None, None)))
    for n, container in enumerate(ax.containers, 1):
        if isinstance(container, BarContainer):
            across = container.orientation == "horizontal"
            labels = {
                tick: text.get_text()
                for tick, text in zip(ax.get_yticks(), ax.get_yticklabels(), strict=True)
            }
            for bar in container:
                if across:
                    middle = bar.get_y() + bar.get_height() / 2
                    name = labels.get(round(middle, 6), "") or _named(container.get_label(), n)
                    yield name, (bar.get_x() + bar.get_width(), round(middle, 6), None, None)
                else:
                    middle = bar.get_x() + bar.get_width() / 2
                    yield _named(container.get_label(), n), (middle, bar.get_height(), None, None)
    for n, patch in enumerate((p for p in ax.patches if isinstance(p, StepPatch)), 1):
        values, edges, _ = patch.get_data()
        for x, y in zip(edges, values, strict=False):
            yield _named(patch.get_label(), n), (float(x), float(y), None, None)
    for n, dots in enumerate((c for c in ax.collections if isinstance(c, PathCollection)), 1):
        for x, y in np.asarray(dots.get_offsets()):
            yield _named(dots.get_label(), n), (float(x), float(y), None, None)
    for image in ax.images:
        values = np.ma.filled(np.ma.asarray(image.get_array(), np.float64), np.nan)
        if values.ndim == 2 and values.size <= _CELLS:
            for row, cells in enumerate(values):
                for column, value in enumerate(cells):
                    yield f"row {row}", (float(column), float(value), None, None)


def _named(label: Any, number: int) -> str:
    """The label of a curve, also one that an underscore keeps out of the legend; Matplotlib's own
    labels are "_child0" and the like."""
    text = _plain(str(label))
    return f"curve {number}" if text.startswith("_child") else text.removeprefix("_")
