"""The figure of the laws of a recording: intervals, excess of each pixel, and its distribution."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from cosim.report.figures import subplots
from sensor.laboratory.laws import Laws

_SEEN: Final = 0.002
"""Least share of intervals that the figure has room for."""
_MOST: Final = 200.0
"""Largest excess of a pixel that the histogram has a place of its own for, %."""
_BINS: Final = 120
"""Bins of the histogram."""


def laws_figure(laws: Laws, title: str, path: Path, kind: str) -> None:
    """Draws the figure. kind: "png" or "svg"."""
    figure, (intervals, chart, excess) = subplots(1, 3, figsize=(12, 4), layout="constrained")
    longest, highest = 1, 0.0
    for law in laws.intervals:
        longest = max(longest, int(np.flatnonzero(law.histogram >= _SEEN).max(initial=0)) + 1)
        highest = max(highest, float(law.histogram.max()))
        lengths = np.arange(1, len(law.histogram) + 1)
        label = f"mean {law.mean:g}: variance {law.variance:.3f}, corr. {law.correlation:.3f}"
        intervals.plot(lengths, law.histogram, marker=".", label=label)
    intervals.set(
        xlim=(0.5, longest + 0.5), ylim=(0, 1.6 * highest or 1.0), xlabel="interval, cycles",
        ylabel="share", title="intervals, by the mean of the pixel",
    )  # fmt: skip
    if laws.intervals:
        intervals.legend(fontsize="x-small", loc="upper right")
    most = max(4 * laws.core, 1e-6)
    shown = chart.imshow(laws.excess * 100, cmap="coolwarm", vmin=-most * 100, vmax=most * 100)
    chart.set(title="rate over the surroundings, %")
    figure.colorbar(shown, ax=chart, shrink=0.8)
    known = laws.excess[np.isfinite(laws.excess)] * 100
    if known.size:
        low, high = np.floor(known.min()), min(np.ceil(known.max()) + 1, _MOST)
        inside = np.minimum(known, high)
        excess.hist(inside, bins=np.linspace(low, high, _BINS + 1), log=True, color="#4a6fa5")
    beyond = f"\n(the last bin: {_MOST:g} or more)" if (known > _MOST).any() else ""
    excess.set(
        xlabel=f"rate over the surroundings, %{beyond}", ylabel="pixels",
        title=f"spread {laws.core:.2%}, kurtosis {laws.kurtosis:.3g}",
    )  # fmt: skip
    figure.suptitle(title)
    figure.savefig(path, format=kind, dpi=110)
