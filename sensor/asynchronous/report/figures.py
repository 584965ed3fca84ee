"""Figures of a run of an asynchronous camera: recovered light, events over time, delays of the
channel."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.report.drawn import Data, save_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from sensor.asynchronous.model import EventModel
from sensor.asynchronous.readout.recover import WITHIN, Recovered

BLUE, PALE = "#2f5fa7", "#e9edf5"
Image = npt.NDArray[np.float64]


def view_figure(
    truth: Image, estimate: Image, silent: npt.NDArray[np.bool_], floor: float, path: Path
) -> Data:
    """True and recovered illuminance side by side on one logarithmic scale, lux.

    Args:
        silent: pixels without an event, drawn in grey.
        floor: lux that is black.
    """
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    norm = LogNorm(floor, max(float(truth.max()), floor * 10))
    figure, axes = subplots(1, 2, figsize=(11, 5.1), layout="constrained")
    colours = colormaps["inferno"].with_extremes(bad="#7b818c")
    for ax, image, name in zip(
        axes,
        (np.maximum(truth, floor), np.ma.masked_where(silent, np.maximum(estimate, floor))),
        ("true illuminance of the pixels", "what each pixel's last event tells (grey: nothing)"),
        strict=True,
    ):
        drawn = ax.imshow(image, norm=norm, cmap=colours, interpolation="nearest")
        ax.set_title(name, fontsize=10, color=INK)
        ax.axis("off")
    bar = figure.colorbar(drawn, ax=axes, fraction=0.035, pad=0.01)
    bar.set_label("lux", color=INK)
    return save_figure(figure, path)


def target_figure(recovered: list[Recovered], dark: float, path: Path) -> Data:
    """Recovered against true illuminance with 99.9 % confidence, and the relative error below.
    dark: lux whose electrons equal the mean dark current."""
    figure, (top, low) = subplots(
        2, 1, figsize=(11, 7.2), sharex=True, height_ratios=(2.2, 1), layout="constrained"
    )
    known = [p for p in recovered if p.estimate is not None and p.estimate > 0]
    lux = np.array([p.lux for p in known])
    value = np.array([p.estimate for p in known], float)
    ends = np.array([[p.low, p.high] for p in known], float).reshape(-1, 2)
    bars = np.maximum(np.abs(ends.T - value), 0)
    span = np.array([min(p.lux for p in recovered) / 2, max(p.lux for p in recovered) * 2])
    top.plot(span, span, color=LINE, linewidth=1, zorder=0, label="_nolegend_")
    if known:
        top.errorbar(
            lux, value, [np.minimum(bars[0], value * 0.999), bars[1]], fmt="o", ms=4.5, color=BLUE,
            capsize=2.5, linewidth=1, label="maximum likelihood, 99.9 %",
        )  # fmt: skip
    plain = [(p.lux, p.plain) for p in recovered if p.plain is not None and p.plain > 0]
    if plain:
        top.plot(*np.array(plain).T, "x", ms=5, color=MARK, label="mean of Q/width and of floors")
    unknown = [(p.lux, p.high) for p in recovered if p.estimate is None and p.high]
    if unknown:
        top.plot(
            *np.array(unknown).T, "v", ms=5, color="#8a909c",
            label="below this, 99.9 %",
        )  # fmt: skip
    highest = max([span[1], *(30 * high for _, high in unknown)])  # with room for the legend
    top.set(
        xscale="log", yscale="log", ylabel="recovered (lux)", xlim=span,
        ylim=(span[0] / 1.3, highest),
    )  # fmt: skip
    if known or plain or unknown:
        top.legend(frameon=False, fontsize=9, loc="upper left")
    low.axhspan(-100 * WITHIN, 100 * WITHIN, color=PALE, zorder=0)
    if known:
        low.errorbar(
            lux, 100 * (value / lux - 1), 100 * bars / lux, fmt="o", ms=4.5, color=BLUE,
            capsize=2.5, linewidth=1, label="of maximum likelihood",
        )  # fmt: skip
    low.plot(
        [p[0] for p in plain], [100 * (p[1] / p[0] - 1) for p in plain], "x", ms=5, color=MARK,
        label="of the mean",
    )  # fmt: skip
    low.set(ylim=(-60, 60), ylabel="error (%)", xlabel="true illuminance of the pixels (lux)")
    for ax in (top, low):
        if span[0] < dark < span[1]:
            ax.axvline(dark, color="#8a909c", linewidth=0.8, linestyle=":")
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelcolor=INK)
        ax.grid(color=LINE, linewidth=0.4)
    if span[0] < dark < span[1]:
        top.annotate(
            "dark current", (dark, 0.02), xycoords=("data", "axes fraction"), rotation=90,
            fontsize=8, color="#5c6577", ha="right",
        )  # fmt: skip
    return save_figure(figure, path)


def events_figure(instant: npt.NDArray[np.int64], stop: int, steady: bool, path: Path) -> Data:
    """Events in bins of time; logarithmic where the light is steady and dim pixels come late."""
    figure, ax = subplots(figsize=(11, 2.8), layout="constrained")
    seconds = instant / 1e12
    if steady and seconds.size:
        least = max(float(seconds.min()) / 1.5, 1e-12)
        bins = np.geomspace(least, stop / 1e12, 160)
        ax.set_xscale("log")
        ax.set_yscale("symlog", linthresh=1)
    else:
        bins = np.linspace(0, stop / 1e12, 201)
    ax.hist(seconds, bins, color=BLUE)
    if not seconds.size:
        ax.set_ylim(0, 1)
    ax.set_xlabel("time (s)", color=INK)
    ax.set_ylabel("events in a bin", color=INK)
    ax.spines[["top", "right"]].set_visible(False)
    return save_figure(figure, path)


def delay_figure(delay: npt.NDArray[np.int64], service: int, path: Path) -> Data:
    """How long events took from firing to having crossed the channel."""
    figure, ax = subplots(figsize=(5.4, 3), layout="constrained")
    micro = np.maximum(delay, 1) / 1e6
    top = max(float(micro.max()), 2 * service / 1e6)
    ax.hist(micro, np.geomspace(service / 1e6 / 1.2, top * 1.1, 60), color=BLUE)
    ax.set(xscale="log", yscale="log", xlabel="delay (µs)", ylabel="events")
    ax.axvline(service / 1e6, color=MARK, linewidth=1)
    ax.set_title("delay in the channel; line: the bus alone", fontsize=10, color=INK)
    ax.spines[["top", "right"]].set_visible(False)
    return save_figure(figure, path)


def width_figure(
    widths: npt.NDArray[np.int64], rate: float, model: EventModel, name: str, path: Path
) -> Data:
    """First widths of one patch, and the law at its estimated rate: what the shortest width holds
    back stands in the first bar. rate: electrons a second."""
    from scipy.special import gammainc

    figure, ax = subplots(figsize=(5.4, 3), layout="constrained")
    tick, q = model.tick, float(model.threshold)
    low, high = int(widths.min()), int(widths.max())
    every = max(1, -(-(high - low + 1) // 40))
    edges = np.arange(low - 1, high + every, every)
    count, _ = np.histogram(widths, edges + 0.5)
    ns = tick / 1e3
    ax.bar((edges[:-1] + edges[1:]) / 2 * ns, count, every * ns * 0.92, color=BLUE, label="pixels")
    law = gammainc(q, rate * np.maximum(edges * tick - model.delay, 0) / 1e12)
    law[edges * tick < model.shortest] = 0
    middle = (edges[:-1] + edges[1:]) / 2 * ns
    ax.plot(
        middle, np.diff(law) * widths.size, "o", ms=3.5, color=MARK, label="law at the estimate"
    )
    ax.set(xlabel="width (ns)", ylabel="pixels")
    ax.set_title(f"first widths, {name}", fontsize=10, color=INK)
    ax.legend(frameon=False, fontsize=8.5)
    ax.spines[["top", "right"]].set_visible(False)
    if not math.isfinite(rate):
        ax.lines[0].remove()
    return save_figure(figure, path)
