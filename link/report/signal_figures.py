"""Figures of a link's signal: eye diagram, soft values, maps of cells, and the camera's view."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import count
from cosim.report.drawn import Data, drawn
from cosim.report.figures import INK, LINE, MARK
from link.evaluation.eye import RARE, Eye
from link.evaluation.record import LinkEvaluation, SoftValues
from link.report.figures import BLUE, figure_at

_DOTTED = 0.02
"""Share of cells with errors up to which each is drawn as a dot."""
_MAPPED = 4000
"""Cells up to which the data of the map hold all of them."""
_HOT = "autumn_r"


def eye_figure(eye: Eye, path: Path) -> Data:
    """Draws the density of traces over two symbols, with the sampling instant and the eye's
    opening."""
    from matplotlib.colors import LogNorm

    with figure_at(path, 8.2, 3.8) as (figure, ax):
        reach, share = float(eye.x[-1]), eye.density / eye.traces
        density = ax.imshow(
            np.where(share > 0, share, np.nan), origin="lower", extent=(-reach, reach, 0, 1),
            aspect="auto", cmap="Blues", norm=LogNorm(1 / eye.traces, 1), interpolation="nearest",
        )  # fmt: skip
        figure.colorbar(density, ax=ax, label="share of traces", pad=0.01)
        most = f"{1 - RARE:.0%}"
        ax.plot(eye.x, eye.low, color=MARK, linewidth=1.2, label=f"{most} of ON are above")
        ax.plot(eye.x, eye.high, color=INK, linewidth=1.2, label=f"{most} of OFF are below")
        left, right = eye.sampled
        ax.axvspan(
            left - reach / 400, right + reach / 400, color=MARK, alpha=0.35, linewidth=0,
            label="sampling instant",
        )  # fmt: skip
        ax.set_xlabel("middle of the window, ticks after the symbol's middle")
        ax.set_ylabel("spikes a pixel and tick")
        figure.legend(fontsize=8.5, loc="outside upper center", ncols=3, frameon=False)
    return drawn(figure)


def soft_figure(values: SoftValues, path: Path) -> Data:
    """Draws the distribution of the soft values of ON and of OFF cells."""
    with figure_at(path, 8.2, 3.0) as (figure, ax):
        top = float(np.quantile(np.abs(values.soft), 0.999)) * 1.1 + 1e-3
        edges = np.linspace(-top, top, 121)
        soft = np.clip(values.soft, edges[0], edges[-1])
        for on, colour, name in ((False, BLUE, "off was sent"), (True, MARK, "on was sent")):
            mine = soft[values.on == on]
            found, _ = np.histogram(mine, edges)
            ax.stairs(
                found / max(mine.size, 1), edges, fill=True, color=colour, alpha=0.45, linewidth=0,
                label=name,
            )  # fmt: skip
            ax.stairs(found / max(mine.size, 1), edges, color=colour, linewidth=1, label=f"_{name}")
        ax.axvline(0, color=INK, linewidth=0.8)
        ax.set_yscale("log")
        ax.set_ylim(0.5 / max(values.soft.size / 2, 1), 1)
        ax.set_xlabel("soft value of a symbol, ln P(spikes | on) - ln P(spikes | off)")
        ax.set_ylabel("share of symbols")
        ax.legend(frameon=False, fontsize=9, loc="upper center", ncols=2)
    return drawn(figure)


def cells_figure(
    quality: npt.NDArray[np.float64], errors: npt.NDArray[np.int64], symbols: int, path: Path
) -> Data:
    """Draws two maps of cells: the certainty of their decisions, and their error rates.

    Few wrong cells are drawn as enlarged dots, so that each is visible.

    Args:
        quality: (rows, columns) mean magnitude of the soft values, nats.
        errors: (rows, columns) wrong decisions, -1 for a cell without data.
        symbols: number of symbols compared.
        path: file.

    Returns:
        Both maps; of many cells, those with errors alone.
    """
    tall = min(max(4.6 * errors.shape[0] / errors.shape[1], 2.0), 9.0) + 0.3
    with figure_at(path, 11, tall, columns=2, plain=False) as (figure, (left, right)):
        carries = errors >= 0
        sure = np.where(carries, quality, np.nan)
        high = float(np.nanquantile(sure, 0.99)) if carries.any() else 1.0
        drawn = left.imshow(
            sure, cmap="viridis", vmin=0, vmax=max(high, 1e-6), interpolation="nearest"
        )
        left.set_title("certainty of decisions", fontsize=10, color=INK)
        figure.colorbar(drawn, ax=left, shrink=0.8, label="mean |soft value| (nats)")
        rate = np.where(carries, errors / max(symbols, 1), np.nan)
        most = float(np.nanmax(rate)) if carries.any() else 0.0
        top, title = max(most, 1 / max(symbols, 1)), "rate of wrong decisions"
        row, column = np.nonzero(np.nan_to_num(rate) > 0)
        if 0 < row.size <= _DOTTED * carries.sum():
            pale = np.where(carries, quality / max(high, 1e-6), np.nan)
            right.imshow(pale, cmap="gray", vmin=-1.2, vmax=1.05, interpolation="nearest")
            order = np.argsort(rate[row, column])
            row, column = row[order], column[order]
            drawn = right.scatter(
                column, row, s=11, c=rate[row, column], cmap=_HOT, vmin=0, vmax=top, linewidths=0
            )
            title = f"{count(row.size)} cells with errors, enlarged"
        else:
            drawn = right.imshow(rate, cmap="inferno", vmin=0, vmax=top, interpolation="nearest")
        right.set_title(title, fontsize=10, color=INK)
        figure.colorbar(drawn, ax=right, shrink=0.8, label="share of wrong decisions")
        for ax in (left, right):
            ax.set_xticks([])
            ax.set_yticks([])
            ax.set_facecolor("#e6e8ec")
            ax.spines[:].set_color(LINE)
    rows, columns = np.nonzero(carries if carries.size <= _MAPPED else errors > 0)
    return Data(
        ("row", "column", "mean |soft value|, nats", "share of wrong decisions"),
        [
            (float(r), float(c), float(quality[r, c]), float(errors[r, c] / max(symbols, 1)))
            for r, c in zip(rows, columns, strict=True)
        ],
    )


def view_figure(link: LinkEvaluation, path: Path) -> None:
    """Draws the average image, with the panel's true outline and the receiver's estimate."""
    height, width = link.image.shape
    tall = min(max(5.4 * height / width, 1.0), 9.0) + 0.3  # a camera may have a few rows
    with figure_at(path, 5.4, tall, plain=False) as (figure, ax):
        ax.imshow(link.image, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        for corners, colour, name, style in (
            (link.truth, BLUE, "true outline of the panel", "-"),
            (link.outline, MARK, "estimate of the receiver", "--"),
        ):
            if corners is not None:
                ring = np.vstack([corners, corners[:1]])
                ax.plot(ring[:, 0], ring[:, 1], style, color=colour, linewidth=1.5, label=name)
        ax.set_xlim(-0.5, width - 0.5)
        ax.set_ylim(height - 0.5, -0.5)
        figure.legend(fontsize=8.5, loc="outside lower center", ncols=2, frameon=False)
        ax.axis("off")
