"""Figures of a run with continuous pixels: reports over time, and what single pixels said
beside their true light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim import Clock, Intensities
from cosim.config.amounts import count
from cosim.report.drawn import Data, save_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from sensor.continuous.shots import PixelLight

BLUE = "#2f5fa7"
BINS = 200


def rate_figure(
    time: npt.NDArray[np.int64], ticks: int, pixels: int, clock: Clock, path: Path
) -> Data:
    """Reports a pixel and second over time. time: ticks of the reports. A bin is whole ticks."""
    figure, ax = subplots(figsize=(11, 2.8), layout="constrained")
    every = -(-ticks // BINS)
    edges = np.minimum(np.arange(0, ticks + every, every), ticks)
    found, _ = np.histogram(time, edges - 0.5)
    rate = found * clock.hz / np.diff(edges) / pixels
    ax.stairs(rate, edges * (1e3 / clock.hz), fill=True, color=BLUE, linewidth=0)
    ax.set_xlim(0, ticks * 1e3 / clock.hz)
    ax.set_xlabel("time (ms)", color=INK)
    ax.set_ylabel("reports/s a pixel", color=INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(LINE)
    ax.tick_params(color=LINE, labelcolor=INK)
    return save_figure(figure, path)


def pixels_figure(
    reports: Intensities, light: PixelLight, per_lux: float, white: float, instants: list[int],
    path: Path,
) -> Data:  # fmt: skip
    """What each pixel reported, held until its next report, and the light on it, white = 1.
    per_lux, white: electrons a second."""
    ms = 1e3 / reports.clock.hz
    true = np.array(light.level, np.float64) * (per_lux / white)
    when = np.array(light.when) / 1e9
    place, stop = reports.pixel, reports.start + reports.ticks
    rows = len(light.points)
    figure, axes = subplots(rows, 1, figsize=(11, 0.95 * rows + 0.8), sharex=True, squeeze=False)
    for n, ((row, column, label), ax) in enumerate(zip(light.points, axes[:, 0], strict=True), 1):
        mine = place == row * reports.shape[1] + column
        times = np.append(reports.time[mine] + 1, stop) * ms  # known at the tick's end
        values = reports.value[mine] / white
        ax.plot(when, true[:, n - 1], color=MARK, linewidth=1, label="true light")
        if values.size:
            ax.step(times, np.append(values, values[-1]), where="post", color=BLUE, linewidth=1.1,
                    label="reported")  # fmt: skip
            ax.plot(times[:-1], values, ".", color=BLUE, markersize=3.5, label="_nolegend_")
        for instant in instants:
            ax.axvline((instant + 0.5) * ms, color=LINE, linewidth=0.8, zorder=0)
        top = max(float(true[:, n - 1].max()), float(values.max(initial=0)), 1e-3)
        ax.set_ylim(0, top * 1.15)
        ax.set_yticks([0, top], ["0", f"{top:.2g}"], fontsize=7, color=INK)
        ax.set_ylabel(
            f"{n}  {label}, {count(mine.sum())}", rotation=0, ha="right", va="center", fontsize=8.5,
            color=INK,
        )  # fmt: skip
        ax.yaxis.set_label_coords(-0.04, 0.5)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(color=LINE, labelcolor=INK)
    axes[-1, 0].set_xlim(0, stop * ms)
    axes[-1, 0].set_xlabel("time (ms); grey lines: the instants shown above", fontsize=9, color=INK)
    axes[0, 0].set_title(
        "reported (blue) and true light of single pixels, white = 1; how often each reported",
        fontsize=10, color=INK,
    )  # fmt: skip
    figure.tight_layout(h_pad=0.15)
    return save_figure(figure, path)
