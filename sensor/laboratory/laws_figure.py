"""The figure of the laws of a recording: intervals, excess of each pixel, and its distribution."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sensor.laboratory.laws import Laws

__all__ = ["laws_figure"]


def laws_figure(laws: Laws, title: str, path: Path, kind: str) -> None:
    """Draws the figure. kind: "png" or "svg"."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4), layout="constrained")
    intervals, chart, excess = figure.subplots(1, 3)
    for law in laws.intervals:
        lengths = np.arange(1, len(law.histogram) + 1)
        label = f"mean {law.mean:g}: variance {law.variance:.3f}, corr. {law.correlation:.3f}"
        intervals.plot(lengths, law.histogram, marker=".", label=label)
    intervals.set(
        xlim=(0.5, 12.5), ylim=(0, 1.4), xlabel="interval, cycles", ylabel="share",
        title="intervals of pixels with the same mean",
    )  # fmt: skip
    if laws.intervals:
        intervals.legend(fontsize="x-small", loc="upper right")
    most = max(4 * laws.core, 1e-6)
    shown = chart.imshow(laws.excess * 100, cmap="coolwarm", vmin=-most * 100, vmax=most * 100)
    chart.set(title="rate over the surroundings, %")
    figure.colorbar(shown, ax=chart, shrink=0.8)
    known = np.clip(laws.excess[np.isfinite(laws.excess)], -0.5, 1.0)
    excess.hist(known * 100, bins=np.arange(-50, 101, 1), log=True, color="#4a6fa5")
    excess.set(
        xlabel="rate over the surroundings, % (ends: beyond)", ylabel="pixels",
        title=f"spread {laws.core:.2%}, kurtosis {laws.kurtosis:.3g}",
    )  # fmt: skip
    figure.suptitle(title)
    figure.savefig(path, format=kind, dpi=110)
