"""Figures of a link's rates, error rates, delays and distances."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.config.amounts import amount, number
from cosim.report.drawn import Data, drawn, write_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from link.evaluation.record import LinkEvaluation
from link.setup.distances import RateAt

BLUE, PALE = "#2f5fa7", "#9db4d8"
_DOTS = 110
_LOWEST = 1e-18
"""Smallest lower limit of an axis of bit error rates."""


def _plain(ax: Any) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(LINE)
    ax.tick_params(which="both", color=LINE, labelcolor=INK, labelsize=8.5)
    ax.xaxis.label.set_color(INK)
    ax.yaxis.label.set_color(INK)


@contextmanager
def figure_at(
    path: Path, width: float, height: float, *, columns: int = 1, plain: bool = True
) -> Iterator[tuple[Any, Any]]:
    """Yields a figure and its axes, and writes it to `path` at the end.

    Args:
        path: file.
        width, height: inches.
        columns: number of axes.
        plain: whether the frame at the top and the right is omitted.
    """
    figure, ax = subplots(1, columns, figsize=(width, height), layout="constrained")
    yield figure, ax
    if plain:
        _plain(ax)
    write_figure(figure, path, _DOTS)


def bits(rate: float) -> str:
    """A rate as text."""
    return amount(rate, "bit/s")


def _bits_axis(rate: float, _: int) -> str:
    return bits(rate) if rate else "0"


def rates_figure(rows: list[tuple[str, float | None]], path: Path) -> Data:
    """Draws bars of rates (name, bit/s); no bar for an unknown rate. Returns them."""
    with figure_at(path, 8.2, 0.45 * len(rows) + 0.7) as (_, ax):
        most = max((rate for _, rate in rows if rate), default=1.0)
        for n, (_, rate) in enumerate(rows):
            ax.barh(n, rate or 0.0, color=BLUE if n else PALE, height=0.62)
            text = "not known" if rate is None else bits(rate)
            ax.text((rate or 0.0) + most * 0.01, n, text, va="center", fontsize=9, color=INK)
        ax.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=9, color=INK)
        ax.invert_yaxis()
        ax.set_xlim(0, most * 1.16)
        ax.xaxis.set_major_formatter(_bits_axis)
    return Data(("rate", "bit/s"), [*rows])


def lowest_rate(values: Sequence[float | None], bits: int) -> float:
    """Lower limit of an axis of bit error rates.

    It is below all positive values and below one error in `bits`, but at least `_LOWEST`.
    """
    positive = [value for value in values if value] + [1 / max(bits, 1), 3e-8]
    return max(min(positive) / 3, _LOWEST)


def errors_figure(link: LinkEvaluation, path: Path) -> Data:
    """Draws the measured raw bit error rate with its interval, and theory, on a logarithmic
    axis. Returns what was drawn."""
    with figure_at(path, 8.2, 1.9) as (_, ax):
        theory, errors = link.theory, link.errors
        rows = [
            ("measured", errors.rate, theory.interval, MARK),
            ("according to the soft values", theory.soft, None, BLUE),
            ("theory (estimate)", theory.closed, theory.closed_interval, BLUE),
        ]
        least = lowest_rate([value for _, value, *_ in rows], errors.bits)
        for n, (_, value, interval, colour) in enumerate(rows):
            if interval is not None:
                low, high = (max(x, least) for x in interval)
                ax.plot([low, high], [n, n], color=colour, linewidth=5, alpha=0.35)
            if value is None:
                ax.text(least * 1.2, n, "not known", va="center", fontsize=8.5, color=INK)
            else:  # a rate below the axis is drawn as an arrow
                ax.plot(
                    max(value, least), n, "o" if value >= least else "<", color=colour,
                    markersize=6, clip_on=False,
                )  # fmt: skip
                text = "none" if value == 0 else number(value, 2)
                ax.annotate(
                    text, (max(value, least), n), (8, 6), textcoords="offset points", fontsize=8.5,
                    color=INK,
                )  # fmt: skip
        ax.set_xscale("log")
        ax.set_xlim(least, 1)
        ax.set_yticks(range(len(rows)), [name for name, *_ in rows], fontsize=9, color=INK)
        ax.set_ylim(len(rows) - 0.4, -0.6)
        ax.set_xlabel("raw bit error rate, before line code and code of the words")
    return Data(
        ("rate", "raw bit error rate", "low, 99.9 %", "high, 99.9 %"),
        [(name, value, *(interval or (None, None))) for name, value, interval, _ in rows],
    )


def delay_figure(link: LinkEvaluation, path: Path) -> Data:
    """Draws the stages one after another, each as long as its median, with whiskers for the
    range. Returns their times."""
    rows = link.latency
    with figure_at(path, 8.2, 0.42 * len(rows) + 0.8) as (_, ax):
        at = 0.0
        for n, row in enumerate(rows):
            ax.barh(n, row.median_us, left=at, color=BLUE, height=0.55)
            ax.plot([at + row.min_us, at + row.max_us], [n, n], color=MARK, linewidth=2)
            ax.annotate(
                number(row.median_us, 4), (at + max(row.median_us, row.max_us), n), (6, -3),
                textcoords="offset points", fontsize=8.5, color=INK,
            )  # fmt: skip
            at += row.median_us
        ax.set_yticks(range(len(rows)), [row.stage for row in rows], fontsize=9, color=INK)
        ax.invert_yaxis()
        ax.set_xlim(0, ax.get_xlim()[1] * 1.12)
        ax.set_xlabel(
            "µs since the arrival of a byte, medians end to end; orange: range of the stage"
        )
    return Data(
        ("stage", "minimum, µs", "median, µs", "maximum, µs"),
        [(row.stage, row.min_us, row.median_us, row.max_us) for row in rows],
    )


def reach_figure(link: LinkEvaluation, rows: list[RateAt], path: Path) -> Data:
    """Draws the predicted rates over distance, with their modes, and the measured point. Returns
    what was drawn, b/s."""
    with figure_at(path, 8.2, 3.3) as (figure, ax):
        works = [row for row in rows if row.rate]
        ax.plot([row.distance for row in works], [row.rate for row in works], "o-", color=BLUE,
                linewidth=1.0, markersize=5, label="goodput predicted by pilots")  # fmt: skip
        for row in works:
            assert row.mode is not None
            ax.annotate(
                f"{row.mode.cell}×{row.mode.cell}, {row.mode.ticks}", (row.distance, row.rate),
                (0, 7), textcoords="offset points", fontsize=7.5, color=INK, ha="center",
            )  # fmt: skip
        here = link.setting.air.distance
        if link.rates.goodput:
            ax.plot(here, link.rates.goodput, "s", color=MARK, label="measured goodput")
        ends = [here, *(row.distance for row in works)]
        ax.set_xlim(min(ends) / 1.15, max(ends) * 1.15)
        ax.set_xscale("log")
        ax.set_yscale("log")
        rates = [row.rate for row in works] + [link.rates.goodput or works[0].rate]
        ax.set_ylim(min(rates) / 2, max(rates) * 2.5)
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter(_some)
        ax.yaxis.set_major_formatter(_bits_axis)
        ax.yaxis.set_minor_formatter(lambda y, _: bits(y) if f"{y:e}"[0] in "25" else "")
        ax.set_xlabel("distance (m)")
        ax.legend(frameon=False, fontsize=8.5)
    return drawn(figure)


def _some(x: float, _: int) -> str:
    """Tick labels between powers of ten: only 2 and 5."""
    return f"{x:g}" if f"{x:e}"[0] in "25" else ""
