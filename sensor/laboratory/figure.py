"""Figures of the laboratory: photon transfer, and the laws of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from cosim.report.figures import INK, LINE, MARK, subplots
from sensor.laboratory.emva import Report
from sensor.laboratory.laws import Laws

_BLUE, _GREEN = "#2f5fa8", "#3a8f5c"
_SEEN: Final = 0.002
"""Least share of intervals that the figure has room for."""
_MOST: Final = 200.0
"""Largest excess of a pixel that the histogram has a place of its own for, %."""
_BINS: Final = 120
"""Bins of the histogram."""


def photon_transfer_figure(report: Report, name: str, path: Path, form: str = "png") -> None:
    """Draws a measurement: on the left temporal and spatial noise over signal, logarithmic, with
    the fitted K and PRNU; on the right the response with the fitted R.

    Args:
        report: the measurement.
        name: name of the camera.
        path: path of the file.
        form: "png" or "svg".
    """
    curve = report.transfer.curve()
    signal, variance = np.array(curve["mean"]), np.array(curve["variance"])
    spatial, photons = np.array(curve["spatial"]), np.array(curve["photons"])
    gain, prnu, response = report["gain"], report["prnu"], report["responsivity"]
    dark = report.transfer.dark
    figure, (left, right) = subplots(1, 2, figsize=(11, 4.4))
    positive = (signal > 0) & (variance > 0)
    left.loglog(signal[positive], np.sqrt(variance[positive]), "o", color=_BLUE, markersize=4,
                label="temporal noise, dark subtracted")  # fmt: skip
    left.loglog(signal, np.sqrt(gain.value * signal), "-", color=_BLUE, linewidth=1,
                label=f"K = {gain.value:.4g} DN/e")  # fmt: skip
    spread = (signal > 0) & (spatial > 0)
    left.loglog(signal[spread], spatial[spread], "s", color=_GREEN, markersize=4,
                label="spatial noise")  # fmt: skip
    if prnu.value > 0:
        left.loglog(signal, prnu.value / 100 * signal, "-", color=_GREEN, linewidth=1,
                    label=f"PRNU = {prnu.value:.3g} %")  # fmt: skip
    left.axhline(float(np.sqrt(dark.variance.mean())), color=INK, linewidth=1, linestyle=":",
                 label="temporal noise in the dark")  # fmt: skip
    left.set_xlabel("signal, DN", fontsize=9, color=INK)
    left.set_ylabel("noise, DN", fontsize=9, color=INK)
    right.plot(photons, signal, "o", color=_BLUE, markersize=4, label="signal")
    end = report.transfer.saturated_photons
    x = np.array([dark.photons, end])
    right.plot(x, response.value * (x - dark.photons), "-", color=_BLUE, linewidth=1,
               label=f"R = {response.value:.4g} DN/photon")  # fmt: skip
    right.axvline(end, color=MARK, linewidth=1, label="saturation: the variance turns")
    right.set_xlabel("photons a pixel", fontsize=9, color=INK)
    right.set_ylabel("signal, DN", fontsize=9, color=INK)
    for ax in (left, right):
        ax.grid(color=LINE, linewidth=0.5)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(colors=INK, labelsize=8.5)
        ax.legend(fontsize=8, frameon=False)
    efficiency, noise = report["quantum_efficiency"], report["dark_noise"]
    figure.suptitle(
        f"{name}: quantum efficiency {efficiency.value:.3g} [{efficiency.low:.3g}, "
        f"{efficiency.high:.3g}], dark noise {noise.value:.3g} e, dynamic range "
        f"{report['dynamic_range'].value:.1f} dB",
        fontsize=10.5, color=INK,
    )  # fmt: skip
    figure.tight_layout()
    figure.savefig(path, dpi=110, format=form)


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
