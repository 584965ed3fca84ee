"""Figures of the EBAPS circuit: figures 6, 7, 9 and 11 of its document, from this run and from the
same device at other voltages and light levels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import count, number
from cosim.light.charts import ASPECT, bar_width, draw, regions
from cosim.report.drawn import Data, save_figure, write_figure
from cosim.report.figures import INK, MARK, subplots
from cosim.report.parts import figure as picture
from cosim.report.parts import plot, table
from cosim.report.png import for_display
from imagers.ebaps.board_report import board_rows
from imagers.ebaps.device.exposure import (
    DARKS,
    ExposureRule,
    mean_of_four,
    residual_variance,
    subtract,
)
from imagers.ebaps.model import EbapsModel, live
from imagers.ebaps.pixels import EbapsPixels
from imagers.report.figures import BLUE, GREEN, stretch, style_axes
from imagers.report.page import ImagerRun
from sensor.frame_pixels import Exposed

VOLTAGES: Final = (0.0, 500.0, 1000.0, 1500.0)
"""Voltages of the document's figure 11, V below ground."""
LIGHT: Final = (3e-1, 3e-2, 3e-3)
"""Lux on the chart; the document names the first and the last."""
SIZE: Final = (144, 180)
"""Rows and columns of the pictures of the grid."""
ROSE: Final = 5.0
"""Contrast to noise below which a bar is not seen (Rose, 1948)."""
Values = npt.NDArray[np.float64]


def ebaps_sections(model: EbapsModel, run: ImagerRun) -> str:
    """The sections of the page; writes their figures."""
    folder = run.folder / "figures"
    loop = _loop(run, folder / "loop.png")
    histogram = _histogram(run, folder / "histogram.png")
    rows = _grid(run, model, folder / "voltages.png")
    return (
        "<h2>The exposure loop</h2><p>Mean brightness of each live frame against the window "
        f"[{count(24_000)}, {count(25_600)}] DN, and the exposure that a constant step of 0.64 ms "
        "makes of it. Hatched frames are dark ones (KEY = 1), taken at the live exposure. A "
        "frame's mean can change the frame after next at the earliest; the loop acts on frames "
        "that show what it last "
        "did.</p>" + plot(folder / "loop.png", "mean brightness and exposure over time", loop)
        + _board(run) + _before_after(model, run)
        + plot(
            folder / "histogram.png", "histograms before and after dark subtraction", histogram
        )
        + "<h2>High voltage and light</h2><p>The document's figure 11: rows are high voltages, "
        "columns the light on the chart; each picture is one live frame less the mean of four "
        "darks of its own exposure, by a device of this kind of "
        f"{SIZE[1]} x {SIZE[0]} pixels under the run's lens, stretched between the 0.5 % and "
        "99.5 % values. The exposure is the one at which the loop would stand. Contrast to noise "
        "is |mean of white - mean of black| over the noise of a single pixel, times the root of "
        f"the largest bar's pixels; below {number(ROSE)} a bar is not recognised (Rose).</p>"
        + plot(folder / "voltages.png", "the chart at four voltages under three lights")
        + table(["high voltage", "light", "exposure", "mean", "contrast to noise", ""], rows)
    )  # fmt: skip


def _board(run: ImagerRun) -> str:
    board = run.imager.board
    if board is None:
        return ""
    head = ["what", "in this run", "by the closed form, or as printed"]
    said = "".join(f"<li>{fault}</li>" for fault in board.faults)
    return (
        "<h2>The board, clock by clock</h2><p>The dark frames and the first live ones passed the "
        "converter's lines, FIFO, AXI4 and memory, the second FPGA, and Camera Link, at "
        f"{number(board.clocks.memory * 1e-6)} MHz and {number(board.clocks.display * 1e-6)} MHz; "
        "each is compared with the frame that was sent.</p>" + table(head, board_rows(board))
        + (f"<ul>{said}</ul>" if said else "")
    )  # fmt: skip


def _loop(run: ImagerRun, path: Path) -> Data:
    rule, taken = ExposureRule(), run.frames
    time = np.array([t.ready for t in taken]) / 1e9
    key = np.array([t.state["key"] for t in taken]) > 0
    mean = np.array([t.state["mean"] for t in taken])
    raw = np.array([t.state["raw_mean"] for t in taken])
    exposure = np.array([t.state["exposure_ns"] for t in taken]) / 1e6
    figure, (top, low) = subplots(2, 1, figsize=(9.5, 5), sharex=True, layout="constrained")
    for axes in (top, low):
        for at in time[key]:
            axes.axvspan(at - 1e3 / 60, at + 1e3 / 60, color=INK, alpha=0.08, linewidth=0)
    top.axhspan(rule.low, rule.high, color=GREEN, alpha=0.18, linewidth=0, label="window")
    top.plot(time[~key], raw[~key], "o", color=MARK, markersize=3, label="before subtraction")
    top.plot(time[~key], mean[~key], "o-", color=GREEN, markersize=3.5, linewidth=0.9,
             label="after it")  # fmt: skip
    top.set_ylim(0, None)
    top.legend(fontsize=8, frameon=False, loc="lower right")
    style_axes(top, y="mean of a frame, DN")
    low.step(time, exposure, where="mid", color=BLUE, linewidth=1.3)
    for limit in (rule.shortest, rule.longest):
        low.axhline(limit / 1e6, color=INK, linewidth=0.7, linestyle=":")
    style_axes(low, "time at which a frame has been read, ms; shaded: dark frames", "exposure, ms")
    return save_figure(figure, path)


def _pair(run: ImagerRun) -> tuple[Any, Any, Any] | None:
    """The last live frame and the mean of the dark frames as stored, and their difference."""
    memory = run.imager.memory
    shown = live(run.frames)
    if not shown or not run.imager.sequencer.subtracts():
        return None
    darks = mean_of_four([memory.read(n) for n in range(DARKS)])
    at = run.frames.index(shown[-1])
    return memory.read(DARKS), darks, run.frame(at)


def _before_after(model: EbapsModel, run: ImagerRun) -> str:
    pair = _pair(run)
    if pair is None:
        return "<h2>Dark subtraction</h2><p>It was off.</p>"
    raw, darks, shown = pair
    low, high = np.percentile(raw, (0.2, 99.8))
    zero, top = np.percentile(shown, (0.2, 99.8))
    floor, ceiling = np.percentile(darks, (0.2, 99.8))
    pictures = [
        picture(for_display(stretch(raw, low, high)), "the last live frame as it was read"),
        picture(for_display(stretch(darks, floor, ceiling)), "the mean of four dark frames"),
        picture(for_display(stretch(shown, zero, top)), "their difference"),
    ]
    return (
        "<h2>Dark subtraction</h2><p>The document's figure 9: a live frame, the mean of the four "
        "dark frames in memory, and the difference, each stretched to its own range. Offsets and "
        "dark current of each pixel go; stripes of rows that scale with the light stay, as in the "
        f'document\'s pictures.</p><div class="grid by3">{"".join(pictures)}</div>'
        + table(["what", "value"], _residual(model, run, darks))
    )


def _residual(model: EbapsModel, run: ImagerRun, darks: Any) -> list[list[str]]:
    """Residual pattern of a dark frame after subtraction of the mean of four, and its theory."""
    seconds = run.imager.sequencer.dark_exposure * 1e-9
    pixels = model.pixels
    rows, columns = pixels.shape
    nothing = Exposed(np.zeros((rows, columns)), np.full(rows, seconds), np.zeros(rows), 0, 1 << 25)
    fresh = pixels.convert(nothing, run.planned.spec.seed, run.planned.kept).astype(float)
    left = fresh - darks
    one = float(pixels.mean_variance(0.0, seconds)[1])
    theory = np.sqrt(residual_variance(one, one))
    return [
        ["spread of a dark frame over its pixels", f"{number(fresh.std(), 4)} DN"],
        ["of the mean of four", f"{number(darks.std(), 4)} DN"],
        ["of a fresh dark frame less that mean", f"{number(left.std(), 4)} DN"],
        [
            "theory: its own noise and a quarter of it, before clipping; a few ion bursts carry "
            "much of it",
            f"{number(theory, 4)} DN",
        ],
    ]


def _histogram(run: ImagerRun, path: Path) -> Data:
    pair = _pair(run)
    figure, axes = subplots(figsize=(9.5, 3), layout="constrained")
    named = (("as read", MARK), ("mean of four darks", INK), ("difference", GREEN))
    if pair is not None:
        top = float(max(np.percentile(each, 99.9) for each in pair))
        bins = np.linspace(0, top, 240)
        for (name, colour), values in zip(named, pair, strict=True):
            counts, _ = np.histogram(values, bins)
            axes.stairs(counts, bins, color=colour, label=name, linewidth=1.1)
        axes.set_yscale("log")
        axes.legend(fontsize=8, frameon=False)
    style_axes(axes, "value, DN", "pixels")
    return save_figure(figure, path)


def _stands(pixels: EbapsPixels, chart: Values, lux: float) -> float:
    """Ideal exposure (s) of the loop: the middle of the window, limited to its range."""
    rule = ExposureRule()
    wanted = (rule.low + rule.high) / 2
    mean = float(chart.mean()) * lux
    dark = pixels.mean_variance(0.0, rule.longest * 1e-9)[0]
    full = pixels.mean_variance(mean * rule.longest * 1e-9, rule.longest * 1e-9)[0] - dark
    seconds = wanted / max(full, 1e-9) * rule.longest * 1e-9
    return float(np.clip(seconds, rule.shortest * 1e-9, rule.longest * 1e-9))


def _grid(run: ImagerRun, model: EbapsModel, path: Path) -> list[list[str]]:
    gain = run.planned.view.gain
    chart = draw("night", SIZE)
    white, black = regions(chart)
    bar = ASPECT * (bar_width("night", SIZE) or 0.0) ** 2
    kept, seed = frozenset(model.pixels.effects), run.planned.spec.seed
    device = replace(model.pixels, shape=SIZE, volts=0.0)
    figure, places = subplots(len(VOLTAGES), len(LIGHT), figsize=(9.5, 10.4), layout="constrained")
    rows = []
    for line, volts in zip(places, VOLTAGES, strict=True):
        pixels = device.at(volts=volts)
        for axes, lux in zip(line, LIGHT, strict=True):
            seconds = _stands(pixels, chart, lux * gain)
            shown, last = (
                _live(pixels, chart * lux * gain, seconds, seed, kept, n) for n in (0, 1)
            )
            noise = np.sqrt(((shown - last)[white].var() + (shown - last)[black].var()) / 4)
            step = abs(float(shown[white].mean() - shown[black].mean()))
            cnr = step * np.sqrt(bar) / max(float(noise), 1e-9)
            low, high = np.percentile(shown, (0.5, 99.5))
            axes.imshow(
                for_display(stretch(shown, low, high)), cmap="gray", vmin=0, vmax=255,
                interpolation="nearest",
            )  # fmt: skip
            axes.set_xticks([])
            axes.set_yticks([])
            axes.set_title(
                f"{_named(volts)}, {number(lux)} lx, {number(seconds * 1e3)} ms: "
                f"{number(cnr)}", fontsize=8.5,
                color=INK if cnr >= ROSE else MARK,
            )  # fmt: skip
            verdict = "recognisable" if cnr >= ROSE else "nothing is recognised"
            rows.append(
                [_named(volts), f"{number(lux)} lx", f"{number(seconds * 1e3, 4)} ms",
                 f"{number(shown.mean(), 5)} DN", number(cnr), verdict]
            )  # fmt: skip
    write_figure(figure, path)
    return rows


def _named(volts: float) -> str:
    return f"-{number(volts)} V" if volts else "0 V"


def _live(
    pixels: EbapsPixels, lux: Values, seconds: float, seed: int, kept: frozenset[str], n: int
) -> Values:
    """A live frame less the mean of four darks, without a pedestal: (H, W) float64."""
    rows = lux.shape[0]
    time, waiting = np.full(rows, seconds), np.zeros(rows)

    def frame(light: Values, number: int) -> npt.NDArray[np.uint16]:
        return pixels.convert(Exposed(light, time, waiting, 0, number), seed, kept)

    darks = mean_of_four([frame(np.zeros_like(lux), 8 * n + d) for d in range(DARKS)])
    return subtract(frame(lux * seconds, 8 * n + DARKS), darks, 2000).astype(np.float64) - 2000
