"""The intervals of chosen pixels as a figure, as in Huang 2022, figure 5."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim import SpikeStream
from cosim.report.figures import INK, LINE, MARK, QUICK, subplots
from sensor.reconstruct.intervals import spike_cycles

__all__ = ["interval_figure"]


def interval_figure(
    stream: SpikeStream,
    points: list[tuple[int, int, str]],
    truth: npt.NDArray[np.float64],
    span: tuple[int, int],
    instants: list[int],
    path: Path,
) -> None:
    """Draws the intervals of single pixels over time. Each is a bar of width tau and of the area
    of one spike, so that its height is the estimate of the light.

    Args:
        stream: spikes.
        points: row, column and name of each pixel.
        truth: (pixels, knots) true rate over the span, spikes/cycle.
        span: first cycle, and the one after the last.
        instants: cycles that are marked.
        path: of the PNG.
    """
    spikes = spike_cycles(stream, [(r, c) for r, c, _ in points])
    ms = 1e3 / stream.clock.hz
    figure, axes = subplots(
        len(points), 1, figsize=(11, 0.85 * len(points) + 0.8), sharex=True, squeeze=False
    )
    times = np.linspace(*span, truth.shape[1]) * ms
    for n, ((_, _, label), cycles, light, ax) in enumerate(
        zip(points, spikes, truth, axes[:, 0], strict=True), 1
    ):
        inside = cycles[(cycles >= span[0] - 255) & (cycles < span[1] + 255)]
        cycles = inside if inside.size > 1 else cycles
        tau = np.diff(cycles)
        if tau.size:
            ax.stairs(1 / tau, (cycles + 1) * ms, fill=True, color="#9db4d8", linewidth=0)
        ax.plot(times, light, color=MARK, linewidth=1)
        for instant in (n for n in instants if span[0] <= n < span[1]):
            ax.axvline((instant + 0.5) * ms, color=LINE, linewidth=0.8, zorder=0)
        top = max(float(light.max()), float(1 / tau.min()) if tau.size else 0, 1e-3) * 1.15
        ax.set_ylim(0, top)
        ax.set_yticks([0, top / 1.15], ["0", f"{top / 1.15:.2g}"], fontsize=7, color=INK)
        ax.set_ylabel(f"{n}  {label}", rotation=0, ha="right", va="center", fontsize=8.5, color=INK)
        ax.yaxis.set_label_coords(-0.04, 0.5)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(color=LINE, labelcolor=INK)
    axes[-1, 0].set_xlim(span[0] * ms, span[1] * ms)
    axes[-1, 0].set_xlabel("time (ms); grey lines: the instants shown above", fontsize=9, color=INK)
    axes[0, 0].set_title(
        "1/ISI of single pixels, spikes a cycle (bars), and the true light (line)",
        fontsize=10,
        color=INK,
    )
    figure.tight_layout(h_pad=0.15)
    figure.savefig(path, dpi=110, pil_kwargs=QUICK)
