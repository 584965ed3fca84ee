"""Figures of a link's run: rates, errors, the eye, soft values, cells, delays, distance."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.report.figures import INK, LINE, MARK, pyplot
from link.evaluation.eye import RARE, Eye
from link.evaluation.finished import LinkRun, SoftValues
from link.evaluation.reach import Reach

__all__ = [
    "bits", "cells_figure", "delay_figure", "errors_figure", "eye_figure", "rates_figure",
    "reach_figure", "soft_figure", "view_figure",
]  # fmt: skip

BLUE, PALE = "#2f5fa7", "#9db4d8"
_DOTS = 110
_DOTTED = 0.02
"""Share of cells with errors up to which each is drawn as a dot."""
_HOT = "autumn_r"
_LOWEST = 1e-18
"""At which an axis of bit error rates begins at the lowest."""


def _plain(ax: Any) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(LINE)
    ax.tick_params(which="both", color=LINE, labelcolor=INK, labelsize=8.5)
    ax.xaxis.label.set_color(INK)
    ax.yaxis.label.set_color(INK)


@contextmanager
def _drawn(
    path: Path, width: float, height: float, *, columns: int = 1, plain: bool = True
) -> Iterator[tuple[Any, Any]]:
    """A figure of so many inches and its axes, written to `path` in the end. plain: without a
    frame at its top and right."""
    plt = pyplot()
    figure, ax = plt.subplots(1, columns, figsize=(width, height), layout="constrained")
    yield figure, ax
    if plain:
        _plain(ax)
    figure.savefig(path, dpi=_DOTS)
    plt.close(figure)


def bits(rate: float) -> str:
    """A rate for a reader."""
    for size, unit in ((1e9, "Gb/s"), (1e6, "Mb/s"), (1e3, "kb/s")):
        if rate >= size:
            return f"{rate / size:.3g} {unit}"
    return f"{rate:.3g} b/s"


def _bits_axis(rate: float, _: int) -> str:
    return bits(rate) if rate else "0"


def rates_figure(rows: list[tuple[str, float | None]], path: Path) -> None:
    """Bars of rates (what, bits a second); no bar where one is not known."""
    with _drawn(path, 8.2, 0.45 * len(rows) + 0.7) as (_, ax):
        most = max((rate for _, rate in rows if rate), default=1.0)
        for n, (_, rate) in enumerate(rows):
            ax.barh(n, rate or 0.0, color=BLUE if n else PALE, height=0.62)
            told = "not known" if rate is None else bits(rate)
            ax.text((rate or 0.0) + most * 0.01, n, told, va="center", fontsize=9, color=INK)
        ax.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=9, color=INK)
        ax.invert_yaxis()
        ax.set_xlim(0, most * 1.16)
        ax.xaxis.set_major_formatter(_bits_axis)


def lowest_rate(values: Sequence[float | None], bits: int) -> float:
    """Where an axis of bit error rates begins: below all that are above 0, `_LOWEST` at
    least, and below one error in `bits`."""
    seen = [value for value in values if value] + [1 / max(bits, 1), 3e-8]
    return max(min(seen) / 3, _LOWEST)


def errors_figure(run: LinkRun, path: Path) -> None:
    """The measured raw bit error rate with its interval beside what theory says, logarithmic."""
    with _drawn(path, 8.2, 1.9) as (_, ax):
        theory, errors = run.theory, run.errors
        shown = [
            ("measured", errors.rate, theory.interval, MARK),
            ("the soft values' own promise", theory.soft, None, BLUE),
            ("theory (estimate)", theory.closed, theory.closed_interval, BLUE),
        ]
        least = lowest_rate([value for _, value, *_ in shown], errors.bits)
        for n, (_, value, interval, colour) in enumerate(shown):
            if interval is not None:
                low, high = (max(x, least) for x in interval)
                ax.plot([low, high], [n, n], color=colour, linewidth=5, alpha=0.35)
            if value is None:
                ax.text(least * 1.2, n, "not known", va="center", fontsize=8.5, color=INK)
            else:  # one below the axis points there
                ax.plot(
                    max(value, least), n, "o" if value >= least else "<", color=colour,
                    markersize=6, clip_on=False,
                )  # fmt: skip
                told = "none" if value == 0 else f"{value:.2g}"
                ax.annotate(
                    told, (max(value, least), n), (8, 6), textcoords="offset points", fontsize=8.5,
                    color=INK,
                )  # fmt: skip
        ax.set_xscale("log")
        ax.set_xlim(least, 1)
        ax.set_yticks(range(len(shown)), [name for name, *_ in shown], fontsize=9, color=INK)
        ax.set_ylim(len(shown) - 0.4, -0.6)
        ax.set_xlabel("raw bit error rate, before line code and Reed-Solomon")


def eye_figure(eye: Eye, path: Path) -> None:
    """Density of traces over two symbols, with the instant of sampling and the eye's opening."""
    from matplotlib.colors import LogNorm

    with _drawn(path, 8.2, 3.8) as (figure, ax):
        reach, share = float(eye.x[-1]), eye.density / eye.traces
        drawn = ax.imshow(
            np.where(share > 0, share, np.nan), origin="lower", extent=(-reach, reach, 0, 1),
            aspect="auto", cmap="Blues", norm=LogNorm(1 / eye.traces, 1), interpolation="nearest",
        )  # fmt: skip
        figure.colorbar(drawn, ax=ax, label="share of traces", pad=0.01)
        most = f"{1 - RARE:.0%}"
        ax.plot(eye.x, eye.low, color=MARK, linewidth=1.2, label=f"{most} of what was on lie above")
        ax.plot(eye.x, eye.high, color=INK, linewidth=1.2, label=f"{most} of what was off below")
        left, right = eye.sampled
        ax.axvspan(
            left - reach / 400, right + reach / 400, color=MARK, alpha=0.35, linewidth=0,
            label="sampled here",
        )  # fmt: skip
        ax.set_xlabel("middle of the window, ticks after the symbol's middle")
        ax.set_ylabel("spikes a pixel and tick")
        figure.legend(fontsize=8.5, loc="outside upper center", ncols=3, frameon=False)


def soft_figure(values: SoftValues, path: Path) -> None:
    """How soft values of cells that were on and off spread."""
    with _drawn(path, 8.2, 3.0) as (_, ax):
        top = float(np.quantile(np.abs(values.soft), 0.999)) * 1.1 + 1e-3
        edges = np.linspace(-top, top, 121)
        soft = np.clip(values.soft, edges[0], edges[-1])
        for on, colour, name in ((False, BLUE, "off was sent"), (True, MARK, "on was sent")):
            mine = soft[values.on == on]
            count, _ = np.histogram(mine, edges)
            ax.stairs(
                count / max(mine.size, 1), edges, fill=True, color=colour, alpha=0.45, linewidth=0,
                label=name,
            )  # fmt: skip
            ax.stairs(count / max(mine.size, 1), edges, color=colour, linewidth=1)
        ax.axvline(0, color=INK, linewidth=0.8)
        ax.set_yscale("log")
        ax.set_ylim(0.5 / max(values.soft.size / 2, 1), 1)
        ax.set_xlabel("soft value of a symbol, ln P(spikes | on) - ln P(spikes | off)")
        ax.set_ylabel("share of symbols")
        ax.legend(frameon=False, fontsize=9, loc="upper center", ncols=2)


def cells_figure(
    quality: npt.NDArray[np.float64], errors: npt.NDArray[np.int64], symbols: int, path: Path
) -> None:
    """Two maps of cells: how sure their decisions were, and how often they were wrong. Few wrong
    cells are drawn as dots, larger than they are, so that each is seen. errors: -1 where a cell
    carries no data."""
    tall = min(max(4.6 * errors.shape[0] / errors.shape[1], 2.0), 9.0) + 0.3
    with _drawn(path, 11, tall, columns=2, plain=False) as (figure, (left, right)):
        carries = errors >= 0
        sure = np.where(carries, quality, np.nan)
        high = float(np.nanquantile(sure, 0.99)) if carries.any() else 1.0
        drawn = left.imshow(
            sure, cmap="viridis", vmin=0, vmax=max(high, 1e-6), interpolation="nearest"
        )
        left.set_title("how sure decisions are: sure is bright", fontsize=10, color=INK)
        figure.colorbar(drawn, ax=left, shrink=0.8, label="mean |soft value| (nats)")
        rate = np.where(carries, errors / max(symbols, 1), np.nan)
        most = float(np.nanmax(rate)) if carries.any() else 0.0
        top, title = max(most, 1 / max(symbols, 1)), "how often decisions are wrong"
        row, column = np.nonzero(np.nan_to_num(rate) > 0)
        if 0 < row.size <= _DOTTED * carries.sum():
            pale = np.where(carries, quality / max(high, 1e-6), np.nan)
            right.imshow(pale, cmap="gray", vmin=-1.2, vmax=1.05, interpolation="nearest")
            order = np.argsort(rate[row, column])
            row, column = row[order], column[order]
            drawn = right.scatter(
                column, row, s=11, c=rate[row, column], cmap=_HOT, vmin=0, vmax=top, linewidths=0
            )
            title = f"{row.size:,} cells with errors, drawn larger than they are"
        else:
            drawn = right.imshow(rate, cmap="inferno", vmin=0, vmax=top, interpolation="nearest")
        right.set_title(title, fontsize=10, color=INK)
        figure.colorbar(drawn, ax=right, shrink=0.8, label="share of symbols decided wrong")
        for ax in (left, right):
            ax.set_xticks([])
            ax.set_yticks([])
            ax.set_facecolor("#e6e8ec")
            ax.spines[:].set_color(LINE)


def delay_figure(run: LinkRun, path: Path) -> None:
    """Stages one after another, each as long as its median, with whiskers from least to most."""
    rows = run.result.latency
    with _drawn(path, 8.2, 0.42 * len(rows) + 0.8) as (_, ax):
        at = 0.0
        for n, row in enumerate(rows):
            ax.barh(n, row.median_us, left=at, color=BLUE, height=0.55)
            ax.plot([at + row.min_us, at + row.max_us], [n, n], color=MARK, linewidth=2)
            ax.annotate(
                f"{row.median_us:.4g}", (at + max(row.median_us, row.max_us), n), (6, -3),
                textcoords="offset points", fontsize=8.5, color=INK,
            )  # fmt: skip
            at += row.median_us
        ax.set_yticks(range(len(rows)), [row.stage for row in rows], fontsize=9, color=INK)
        ax.invert_yaxis()
        ax.set_xlim(0, ax.get_xlim()[1] * 1.12)
        ax.set_xlabel(
            "us since a byte came, medians end to end; orange: least to most of the stage"
        )


def reach_figure(run: LinkRun, path: Path) -> None:
    """Predicted rate over distance, with the modes, and the measured point."""
    with _drawn(path, 8.2, 3.3) as (_, ax):
        distance = np.array([r.distance for r in run.reach])
        rate = np.array([r.rate for r in run.reach])
        works = rate > 0
        ax.step(distance, np.where(works, rate, np.nan), where="mid", color=BLUE, linewidth=1.4,
                label="predicted by closed forms: coded rate of the best mode")  # fmt: skip
        here = run.setting.air.distance
        ends = [here, *distance[works]]
        ax.set_xlim(min(ends) / 1.1, max(ends) * 1.25)
        for middle, rate_there, text in _stretches(run.reach, *ax.get_xlim()):
            ax.annotate(
                text, (middle, rate_there), (0, 5), textcoords="offset points",
                fontsize=7.5, color=INK, ha="center",
            )  # fmt: skip
        ax.plot(here, run.rates.coded, "o", color=PALE, label="coded rate of this run's mode")
        if run.rates.goodput:
            ax.plot(here, run.rates.goodput, "o", color=MARK, label="measured goodput")
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylim(top=max(*rate, run.rates.coded) * 2)
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter(_some)
        ax.yaxis.set_major_formatter(_bits_axis)
        ax.set_xlabel("distance (m)")
        ax.legend(frameon=False, fontsize=8.5)


def _stretches(rows: list[Reach], left: float, right: float) -> list[tuple[float, float, str]]:
    """Where one cell and symbol length is the best: the distance of its name's middle, its highest
    rate, and the name, which stands right of the line that falls to it; those left out for whose
    names an axis from left to right has no room."""
    found: list[tuple[float, float, str]] = []
    free = 0.0
    per_letter = 0.0068 * math.log(right / left)
    before = None
    for size, each in itertools.groupby(rows, lambda r: r.mode and (r.mode.cell, r.mode.ticks)):
        held = list(each)
        first, last = held[0].distance, held[-1].distance
        falls, before = (before + first) / 2 if before else left, last
        if size is None:
            continue
        text = f"{size[0]}x{size[0]}, {size[1]} ticks"
        half = len(text) * per_letter / 2
        middle = max(math.log(first * last) / 2, math.log(falls) + per_letter + half)
        if middle - half >= free or not found:
            found.append((math.exp(middle), max(r.rate for r in held), text))
            free = middle + half
    return found


def _some(x: float, _: int) -> str:
    """Labels of the ticks between powers of ten: of 2 and 5 alone."""
    return f"{x:g}" if f"{x:e}"[0] in "25" else ""


def view_figure(run: LinkRun, path: Path) -> None:
    """What the camera saw on average, with the panel's outline as it is and as it was found."""
    height, width = run.image.shape
    with _drawn(path, 5.4, 5.4 * height / width + 0.3, plain=False) as (figure, ax):
        ax.imshow(run.image, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        for corners, colour, name, style in (
            (run.truth, BLUE, "the panel as it stands", "-"),
            (run.outline, MARK, "as the receiver found it", "--"),
        ):
            if corners is not None:
                ring = np.vstack([corners, corners[:1]])
                ax.plot(ring[:, 0], ring[:, 1], style, color=colour, linewidth=1.5, label=name)
        ax.set_xlim(-0.5, width - 0.5)
        ax.set_ylim(height - 0.5, -0.5)
        figure.legend(fontsize=8.5, loc="outside lower center", ncols=2, frameon=False)
        ax.axis("off")
