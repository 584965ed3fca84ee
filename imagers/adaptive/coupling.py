"""What switching logic adds to the frames of a run: metrics, and the section of the report that
compares both codes with and without idle phases."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import amount, number
from cosim.report.drawn import save_figure
from cosim.report.figures import MARK, subplots
from cosim.report.parts import plot, table
from cosim.run.result import Metric
from imagers.adaptive.device.imager import AdaptiveExposure
from imagers.adaptive.device.signals import Code, Coupling, row_kicks
from imagers.report.figures import BLUE, style_axes

CODES: Final[tuple[tuple[Code, str], ...]] = (("binary", MARK), ("gray", BLUE))
PHASES: Final = ((False, "no idle phase"), (True, "idle phase"))


def _kicks(imager: AdaptiveExposure, coupling: Coupling) -> npt.NDArray[np.float64]:
    """(frames, rows) charge that this coupling adds to the frames that the imager has filmed, e."""
    numbers = range(len(imager.timings) - 1)
    return np.stack([row_kicks(imager.timing, imager.timings, n, coupling) for n in numbers])


def _figures(kicks: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    """Mean of the added charge, its RMS deviation over all rows and frames, and that of the means
    of the rows."""
    return float(kicks.mean()), float(kicks.std()), float(kicks.mean(axis=0).std())


def coupled_metrics(imager: AdaptiveExposure) -> dict[str, Metric]:
    """Metrics of a run with a coupling, e; none without."""
    if imager.coupling is None:
        return {}
    names = ("coupling_mean", "coupling_noise", "coupling_rows")
    figures = _figures(_kicks(imager, imager.coupling))
    return {
        name: Metric(value, "e", "no reset was disturbed")
        for name, value in zip(names, figures, strict=True)
    }


def coupling_section(imager: AdaptiveExposure, path: Path) -> str:
    """Writes the figure of a run with a coupling and returns the HTML of the section; nothing
    without a coupling, or with one of no charge."""
    coupling = imager.coupling
    if coupling is None or not coupling.charge:
        return ""
    figure, axes = subplots(2, 1, figsize=(9.5, 4.4), sharex=True, layout="constrained")
    rows = []
    for ax, (idle, phase) in zip(axes, PHASES, strict=True):
        highest = 0.0
        for code, colour in CODES:
            corner = replace(coupling, code=code, idle=idle)
            kicks = _kicks(imager, corner)
            rows_of, middle = np.arange(kicks.shape[1]), kicks.mean(axis=0)
            low, high = kicks.min(axis=0), kicks.max(axis=0)
            ax.fill_between(rows_of, low, high, color=colour, alpha=0.2, linewidth=0)
            ax.plot(rows_of, middle, color=colour, linewidth=0.9, label=f"{code} code")
            highest = max(highest, float(high.max()))
            name = f"{code} code, {phase}" + (" (this run)" if corner == coupling else "")
            rows.append([name, *(f"{number(value)} e" for value in _figures(kicks))])
        ax.set_ylim(0, 1.3 * highest or 1.0)
        style_axes(ax, y=f"added charge, e\n{phase}")
    axes[0].legend(fontsize=8, frameon=False, loc="upper right", ncols=2)
    axes[1].set_xlabel("row", fontsize=9)
    data = save_figure(figure, path)
    noise = imager.pixels.setting.read_noise
    return (
        "<h2>Switching logic and the pixels</h2><p>Every bit of a counter that toggles couples "
        f"{number(coupling.charge, 4)} e onto the pixels, which decays with a time constant of "
        f"{amount(coupling.time_constant, 's')} (both assumed). The counters of this run step as "
        "its exposures make them; the table and the figure show what they would add to its frames "
        "in both codes, with and without idle phases. A row is sampled in all columns together, so "
        "the disturbance is a pattern of rows: noise is its RMS deviation from the mean over rows "
        "and frames, fixed pattern the part that stays in a row. Read noise is "
        f"{number(noise)} e. In the figure, lines are the mean over the frames, bands the least "
        "and the most of a frame.</p>"
        + table(["counters", "mean", "noise, RMS", "fixed pattern, RMS"], rows)
        + plot(path, "charge that switching logic adds to each row, four ways", data)
    )
