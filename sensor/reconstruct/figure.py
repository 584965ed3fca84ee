"""The intervals of chosen pixels as a figure, as in Huang 2022, figure 5."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim import SpikeStream
from cosim.report.drawn import Data, Value, write_figure
from cosim.report.figures import INK, LINE, MARK, canvas_of, subplots
from sensor.reconstruct.intervals import spike_cycles

_DOTS = 110
"""Dots an inch."""
_PITCH = 0.85
"""Inches from one pixel to the next."""
_HIGH = 0.9
"""Height of a pixel's part, pitches."""


def interval_figure(
    stream: SpikeStream,
    points: list[tuple[int, int, str]],
    truth: npt.NDArray[np.float64],
    span: tuple[int, int],
    instants: list[int],
    path: Path,
) -> Data:
    """Draws the intervals of single pixels over time. Each is a bar of width tau and of the area
    of one spike, so that its height is the estimate of the light.

    Args:
        stream: spikes.
        points: row, column and name of each pixel.
        truth: (pixels, knots) true rate over the span, spikes/cycle.
        span: first cycle, and the one after the last.
        instants: cycles that are marked.
        path: path of the PNG.

    Returns:
        The bars and the light drawn: pixel, time, spikes a cycle.
    """
    places = [(r, c) for r, c, _ in points]
    spikes = spike_cycles(stream, places, (span[0] - 255, span[1] + 255))
    if min(len(cycles) for cycles in spikes) < 2:  # intervals that are longer than the span
        every = spike_cycles(stream, places)
        spikes = [a if len(a) > 1 else b for a, b in zip(spikes, every, strict=True)]
    ms, rows = 1e3 / stream.clock.hz, len(points)
    size = 11, _PITCH * rows + 0.8
    figure, ax = subplots(figsize=size)
    figure.dpi = _DOTS
    canvas = canvas_of(figure)
    begin, end = (cycle * ms for cycle in span)
    times = np.linspace(begin, end, truth.shape[1])
    bases = np.arange(rows)[::-1]
    marked = [(instant + 0.5) * ms for instant in instants if span[0] <= instant < span[1]]
    ax.vlines(marked * rows, np.repeat(bases, len(marked)), np.repeat(bases + _HIGH, len(marked)),
              color=LINE, linewidth=0.8, zorder=0)  # fmt: skip
    ticks, texts, names = [], [], []
    rows_of: list[tuple[Value, ...]] = []
    # One pair of axes: each further one takes as long as all that is drawn in it.
    for n, ((_, _, label), cycles, light, base) in enumerate(
        zip(points, spikes, truth, bases, strict=True), 1
    ):
        tau = np.diff(cycles)
        largest = max(float(light.max()), float(1 / tau.min()) if tau.size else 0, 1e-3)
        scale = _HIGH / (1.15 * largest)
        if tau.size:
            edges, heights = (cycles + 1) * ms, base + scale / tau
            ax.fill_between(edges, base, np.append(heights, heights[-1]), step="post",
                            color="#9db4d8", linewidth=0)  # fmt: skip
        ax.plot(times, base + scale * light, color=MARK, linewidth=1)
        rows_of += [
            (f"{n} {label}", "1/ISI", float(time), float(rate))
            for time, rate in zip((cycles + 1) * ms, 1 / tau, strict=False)
        ]
        rows_of += [
            (f"{n} {label}", "true light", float(time), float(rate))
            for time, rate in zip(times, light, strict=True)
        ]
        ticks += [base, base + scale * largest]
        texts += ["0", f"{largest:.2g}"]
        names.append(
            ax.text(-0.04, base + _HIGH / 2, f"{n}  {label}", ha="right", va="center",
                    fontsize=8.5, color=INK, transform=ax.get_yaxis_transform())
        )  # fmt: skip
    style = {"color": LINE, "linewidth": 0.8, "clip_on": False}
    ax.vlines([begin] * rows, bases, bases + _HIGH, **style)
    ax.hlines(bases, begin, end, **style)
    ax.spines[:].set_visible(False)
    ax.set_xlim(begin, end)
    ax.set_ylim(0, rows - 1 + _HIGH)
    ax.set_yticks(ticks, texts, fontsize=7, color=INK)
    ax.tick_params(color=LINE, labelcolor=INK)
    ax.set_xlabel("time (ms); grey lines: the instants shown above", fontsize=9, color=INK)
    ax.set_title(
        "1/ISI of single pixels, spikes a cycle (bars), and the true light (line)",
        fontsize=10,
        color=INK,
    )
    wide, tall = size
    widest = max(name.get_window_extent(canvas.get_renderer()).width for name in names) / _DOTS
    right = 1 - 0.1 / wide
    left = (widest + 0.1 + 0.04 * wide * right) / (1.04 * wide)
    figure.subplots_adjust(left, 0.6 / tall, right, 1 - 0.35 / tall)
    write_figure(figure, path, _DOTS)
    return Data(("pixel", "curve", "time, ms", "spikes/cycle"), rows_of)
