"""What of the recordings the model does not explain, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.calibrate.band import Band
from sensor.calibrate.defects import Defects, dark_rates
from sensor.calibrate.histograms import Histogram
from sensor.calibrate.known import Parameter
from sensor.calibrate.noise import Noise
from sensor.calibrate.pattern import PatternFit
from sensor.calibrate.trains import SIGNIFICANT, Trains
from sensor.device.pattern import CORRELATED
from sensor.latched.sampling import MOST_JITTER

CHANCE: Final = 1e-4
"""Chance below which a deviation is named."""
_SPREAD: Final = 0.5
"""Relative spread of the hot pixels' current from which it is not one current."""


def misfits(
    histograms: Sequence[Histogram], noise: Noise, fit: PatternFit | None, reset: Parameter,
    dark: Trains | None, good: npt.NDArray[np.bool_], defects: Defects, flats: Sequence[Trains],
    shade: npt.NDArray[np.float64], band: Band | None,
) -> list[str]:  # fmt: skip
    """A line for each deviation: which number, how large, and what it may be."""
    from scipy.stats import chi2

    out = []
    if reset.value == "hard":
        out.append(
            "reset rule: the pixels are reset to zero at the latch, where the model of this "
            "calibration carries the residual; rates above 0.1 spikes a cycle are rounded down, so "
            "dead time and pattern of bright flats are not to be trusted"
        )
    for each in histograms:
        if each.chance < CHANCE and noise.mixed:  # else pixels round alike, and are not independent
            out.append(
                f"intervals of {each.name}: chi-square {each.chi_square:.0f} for {each.bins} bins, "
                f"{each.off:.2%} of the intervals misplaced, most at {each.worst} cycles"
            )
    levels = noise.levels
    if len(levels) > 1:
        far = sum(
            ((level.squared.value - noise.squared.value) / level.squared.error) ** 2
            for level in levels
        )
        if chi2.sf(far, len(levels) - 1) < CHANCE:
            values = ", ".join(f"{max(v.squared.value, 0) ** 0.5:.4g}" for v in levels)
            out.append(
                f"noise of an interval is not the same at all levels ({values}): light that "
                "flickers, a leak, or noise that depends on time"
            )
    if noise.timing and (band is None or band.jitter > MOST_JITTER):
        out.append(
            f"latch: intervals have a timing noise of {max(noise.jitter.value, 0) ** 0.5:.3g} "
            "cycles that does not accumulate; sensor.row_jitter is of a band of rows, "
            f"{MOST_JITTER:g} at most"
        )
    if fit is not None and not fit.converged:
        out.append(
            "levels: no parameters of pattern, dark current and dead time explain the rates; those "
            "given are not to be trusted"
        )
    if fit is not None:
        size, deviations = fit.misfit
        if deviations > SIGNIFICANT:
            out.append(
                f"levels: rates of pixels are {size:.3g} times as far from one gain, one dark "
                "current and one dead time as noise allows: response that is not linear, or light "
                "whose distribution changed"
            )
    out += _neighbours(flats, good, shade)
    if dark is not None and defects.hot is not None and int(defects.hot.sum()) > 5:
        rates = dark_rates(dark)
        excess = rates[defects.hot] - np.median(rates)
        if float(excess.std() / excess.mean()) > _SPREAD:
            out.append(
                f"hot pixels: their currents spread by {excess.std() / excess.mean():.0%}, not "
                "one current; see sensor.pattern.warm_pixels"
            )
    return out


def _neighbours(
    flats: Sequence[Trains], good: npt.NDArray[np.bool_], shade: npt.NDArray[np.float64]
) -> list[str]:
    """Whether neighbouring pixels have responses in common that no pattern has: those of one are
    not below 0, and at most CORRELATED."""
    if not flats:
        return []
    brightest = max(flats, key=lambda each: each.rate)
    gain = brightest.spikes / brightest.spikes[good].mean() - 1 - shade
    plane = np.where(good, gain, np.nan).reshape(brightest.shape)
    out = []
    for name, a, b in (
        ("a row", plane[:, :-1], plane[:, 1:]), ("a column", plane[:-1], plane[1:]),
    ):  # fmt: skip
        both = np.isfinite(a) & np.isfinite(b)
        if both.sum() < 50:
            continue
        correlation = float(np.corrcoef(a[both], b[both])[0, 1])
        error = SIGNIFICANT / np.sqrt(both.sum())
        if correlation < -error or correlation > CORRELATED + error:
            out.append(
                f"neighbours in {name}: responses correlate by {correlation:+.3f}: circuits "
                "that they share, or light that is not uniform"
            )
    return out
