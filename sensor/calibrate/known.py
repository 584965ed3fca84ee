"""Parameters with their intervals, from the fits: what is known, what is not, and why."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import amount
from sensor.calibrate.defects import Defects, dark_rates
from sensor.calibrate.noise import Noise
from sensor.calibrate.pattern import PatternFit
from sensor.calibrate.trains import Trains

DEVIATIONS = 1.959964
"""Standard errors to either side that hold 95 % of a normal law."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of the model.

    Attributes:
        name: key of a document.
        title: title in a table.
        value: estimate; None if there is none. The reset rule is a word.
        ci: limits at 95 %; None on a side without a limit.
        unit: unit of value and limits, "1" for none.
        known: whether the recordings determine it.
        why: how it is known, or why it cannot be.
        remedy: what would make it known; "" for a known one.
    """

    name: str
    title: str
    value: float | str | None
    ci: tuple[float | None, float | None]
    unit: str
    known: bool
    why: str
    remedy: str = ""

    def holds(self, truth: float) -> bool:
        """Whether a value lies within the limits."""
        low, high = self.ci
        return bool((low is None or low <= truth) and (high is None or truth <= high))

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "title": self.title, "value": self.value, "ci": list(self.ci), "unit": self.unit,
            "known": self.known, "why": self.why, "remedy": self.remedy or None,
        }  # fmt: skip

    @property
    def text(self) -> str:
        """Value and limits for a table; "" without either."""
        value = self.value if isinstance(self.value, str) else self._text(self.value)
        low, high = self.ci
        bare = "s" if self.unit == "s" else "1"  # prefixes of times differ
        if self.value is not None:
            limits = f"{self._text(low, bare)} to {self._text(high, bare)}"
            return value if low is high is None else f"{value}, {limits}"
        if high is None:
            return "" if low is None else f"at least {self._text(low)}"
        if not low:
            return f"at most {self._text(high)}"
        return f"{self._text(low, bare)} to {self._text(high)}"

    def _text(self, value: float | None, unit: str | None = None) -> str:
        return "?" if value is None else amount(value, unit or self.unit, 4)


def rooted(square: float, error: float) -> tuple[float, tuple[float, float]]:
    """Root of an estimated square and its limits: the roots of those of the square, 0 below 0."""
    low, high = (max(square + k * DEVIATIONS * error, 0.0) ** 0.5 for k in (-1, 1))
    return max(square, 0.0) ** 0.5, (low, high)


def proportion(count: int, total: int) -> tuple[float, tuple[float, float]]:
    """A share and its exact limits (Clopper and Pearson, Biometrika 26:404, 1934)."""
    from scipy.stats import beta

    low = float(beta.ppf(0.025, count, total - count + 1)) if count else 0.0
    high = float(beta.ppf(0.975, count + 1, total - count)) if count < total else 1.0
    return count / total, (low, high)


_TOLD: Final = 2.0
"""Ratio of the limits of the threshold from which it counts as known."""
_NOISE: Final = "temporal noise of an interval, relative"
_OF_THRESHOLD: Final = "noise of the threshold (kTC and comparator), over the threshold"
_LATCH: Final = "timing noise of the latch"
_DARK: Final = "record with the lens capped: --dark DARK.dat"


def noise_parameters(noise: Noise, dead_error: float) -> list[Parameter]:
    """Noise of an interval, threshold in electrons, and noise of the threshold.

    dead_error: standard error of the dead time, cycles.
    """
    error = math.hypot(noise.squared.error, noise.slope * dead_error)
    squared = noise.squared.value
    if not noise.mixed:
        most = max(squared + DEVIATIONS * error, noise.most)
        return _noise_bounds(math.sqrt(max(squared, 0.0)), math.sqrt(most))
    sigma, ci = rooted(squared, error)
    out = [Parameter(
        "interval_noise", _NOISE, sigma, ci, "1", True,
        "growth of the variance of sums of k intervals with k; the latch's rounding does not grow",
    )]  # fmt: skip
    most = max(squared + DEVIATIONS * error, 1e-18)
    low, high, value = 1 / most, None, None
    if noise.third is not None:
        least, largest = (noise.third.value + k * DEVIATIONS * noise.third.error for k in (-1, 1))
        if largest > 0:
            low = max(low, largest**-0.5)
        if least > 0:
            high = max(least**-0.5, low)
    if high is not None and high < _TOLD * low and noise.third is not None:
        value = min(max(noise.third.value**-0.5, low), high)
    known = value is not None
    out.append(Parameter(
        "threshold", "threshold", value, (low, high), "e", known,
        "skewness of the intervals: 2/sqrt(Q) for the shot noise of Q electrons"
        if known else "shot noise 1/Q and noise of the threshold add up in each spike, at any "
        "light; only 1/Q <= noise^2 is certain, and the skewness that tells them apart is too "
        "small here",
        "" if known else "a light meter (electrons for each spike), or many more spikes",
    ))  # fmt: skip
    quiet = math.sqrt(max(max(squared - DEVIATIONS * error, 0) - 1 / low, 0.0))
    loud = math.sqrt(max(most - (1 / high if high is not None else 0.0), 0.0))
    share = None if value is None else math.sqrt(max(squared - 1 / value, 0.0))
    out.append(Parameter(
        "threshold_noise", _OF_THRESHOLD,
        share, (quiet, loud), "1", known,
        "temporal noise less the shot noise of the threshold in electrons"
        if known else "what shot noise leaves of the temporal noise; see threshold",
        "" if known else "as for threshold",
    ))  # fmt: skip
    jitter, limits = rooted(noise.jitter.value, noise.jitter.error)
    if not noise.timing:
        jitter, limits = 0.0, (0.0, limits[1])
    out.append(Parameter(
        "latch_noise", _LATCH, jitter, limits, "cycles", True,
        "variance of an interval that does not grow with the number of intervals, beyond 1/6",
    ))  # fmt: skip
    return out


def _noise_bounds(shown: float, most: float) -> list[Parameter]:
    """The parameters of noise where phases are not mixed. shown: sigma that the variances have, of
    noise or of rounding. most: its limit."""
    why = (
        "pixels are alike and nearly free of noise, so that the latch rounds their spikes alike; "
        "rounding that is alike looks like noise, or hides it"
    )
    remedy = "a longer recording, or light that is not the same on all pixels"
    return [
        Parameter("interval_noise", _NOISE, shown, (0.0, most), "1", False, why, remedy),
        Parameter("threshold", "threshold", None, (1 / most**2, None), "e", False,
                  "1/Q is at most the noise squared", f"{remedy}, and a light meter"),
        Parameter("threshold_noise", _OF_THRESHOLD, None, (0.0, most), "1", False, why, remedy),
        Parameter("latch_noise", _LATCH, None, (None, None), "cycles", False, why, remedy),
    ]  # fmt: skip


def pattern_parameters(
    fit: PatternFit, hertz: float, dark: Trains | None, dim: bool
) -> list[Parameter]:
    """Fixed pattern, dark current and dead time.

    Args:
        fit: fit of the flats, with the dark recording if it has spikes enough.
        hertz: clock.
        dark: the dark recording; None for none.
        dim: whether the dark recording has too few spikes to be in the fit.
    """
    whole, limits = rooted(fit.gain, fit.error(0, 1, 0, 0, 0))
    out = [Parameter(
        "gain_spread", "spread of the pixels' response to light, in all", whole, limits, "1", True,
        "variance over pixels in the flats, less temporal noise and a smooth shading",
    )]  # fmt: skip
    common, dark_rate = fit.common, fit.dark
    if common is None or dark_rate is None or fit.dark_spread is None:
        why = "in light alone, gain of light and threshold of a pixel scale the same number"
        remedy = (
            "a dark recording with spikes: longer, or warmer" if dim else
            f"{_DARK}, long enough for a spike a pixel: dark charge has the threshold's spread, "
            "not the gain's"
        )  # fmt: skip
        for name, title in (("prnu", "PRNU"), ("threshold_fpn", "spread of the threshold")):
            out.append(Parameter(name, title, None, (0.0, limits[1]), "1", False, why, remedy))
        out += _dark_bound(dark, hertz)
    else:
        whence = (
            "light less what the stated ratios of the flats explain" if dark is None
            else "likelihood of the spikes in the dark, with intervals longer than the recording"
        )  # fmt: skip
        out += _separated(fit, common, dark_rate, fit.dark_spread, hertz, whence)
    if fit.dead is None:
        interval = 1 / (float(fit.light.max()) + (dark_rate or 0.0))  # without dead time: measured
        out.append(Parameter(
            "dead_time", "dead time", None, (0.0, interval / hertz), "s", False,
            "at one light level it scales the rate as the light does; it is not longer than the "
            f"mean interval, {interval:.3g} cycles",
            "a second flat, several times brighter: --flat A.dat --flat B.dat",
        ))  # fmt: skip
        return out
    error = fit.error(0, 0, 0, 0, 1)
    low, high = (max(fit.dead + k * DEVIATIONS * error, 0.0) / hertz for k in (-1, 1))
    certain = dark_rate is not None or dim
    out.append(Parameter(
        "dead_time", "dead time", max(fit.dead, 0.0) / hertz, (low, high), "s", certain,
        "compression of the pixels' spread at the brighter levels by 1 - rate x dead time"
        + ("" if certain else ", if dark current is none: its spread is in the dim levels"),
        "" if certain else _DARK,
    ))  # fmt: skip
    return out


def _separated(
    fit: PatternFit, common: float, dark: float, spread: float, hertz: float, whence: str
) -> list[Parameter]:
    """PRNU, spread of the threshold, dark current and DSNU."""
    fpn, fpn_ci = rooted(common, fit.error(0, 0, 0, 1, 0))
    prnu, prnu_ci = rooted(fit.gain - common, fit.error(0, 1, 0, -1, 0))
    dsnu, dsnu_ci = rooted(spread - common, fit.error(0, 0, 1, -1, 0))
    scale = hertz / (1 + max(common, 0.0))  # the mean of 1/(1 + f) is 1 + fpn^2
    half = DEVIATIONS * fit.error(1, 0, 0, 0, 0) * scale
    current = dark * scale
    return [
        Parameter(
            "prnu", "PRNU", prnu, prnu_ci, "1", True,
            "variance in the flats less what it has in common with the dark",
        ),
        Parameter(
            "threshold_fpn", "spread of the threshold", fpn, fpn_ci, "1", True,
            "covariance over pixels of response to light and dark current: the threshold scales "
            "both, the gain of light one",
        ),
        Parameter(
            "dark_current", "dark current over the threshold", current,
            (max(current - half, 0.0), current + half), "1/s", True,
            f"{whence}; times the threshold it is in e/s",
        ),
        Parameter(
            "dsnu", "DSNU, relative to the dark current", dsnu, dsnu_ci, "1", True,
            "variance of dark current over pixels, less the spread of the threshold",
        ),
    ]  # fmt: skip


def _dark_bound(dark: Trains | None, hertz: float) -> list[Parameter]:
    """Dark current without a fit."""
    if dark is None:
        value, low, high = None, None, None
        why = "light and dark current add up in each pixel; no recording is without light"
        remedy = f"{_DARK}; or stated ratios of the flats' light: --flat A.dat=1 --flat B.dat=2"
    else:
        from scipy.stats import chi2

        # Few spikes of many pixels: a Poisson count with its exact limits (Garwood 1936).
        count, exposure = int(dark.spikes.sum()), dark.spikes.size * dark.cycles / hertz
        low = float(chi2.ppf(0.025, 2 * count) / 2 / exposure) if count else 0.0
        high = float(chi2.ppf(0.975, 2 * count + 2) / 2 / exposure)
        value = count / exposure
        why, remedy = f"{count} spikes of all pixels in the dark", ""
    unknown = Parameter(
        "dsnu", "DSNU, relative to the dark current", None, (None, None), "1", False,
        "too few spikes in the dark" if dark else why,
        "a longer or warmer dark recording" if dark else _DARK,
    )  # fmt: skip
    return [
        Parameter(
            "dark_current", "dark current over the threshold", value, (low, high), "1/s",
            dark is not None, why, remedy,
        ),
        unknown,
    ]  # fmt: skip


def defect_parameters(
    defects: Defects, dark: Trains | None, fit: PatternFit | None, hertz: float
) -> list[Parameter]:
    """Shares of hot, dead and stuck pixels, and the current of hot ones."""
    out = []
    if defects.hot is None or dark is None:
        out.append(Parameter(
            "hot_pixels", "hot pixels, share", None, (None, None), "1", False,
            "cannot be known in light: a bright pixel may be hot, or have a high gain", _DARK,
        ))  # fmt: skip
    else:
        out.append(_share("hot", defects.hot, ", beyond six spreads of the dark rate"))
        if defects.hot.any() and fit is not None and fit.dark is not None:
            out.append(_hot_current(defects, dark, fit, hertz))
    if defects.dead is None:
        out.append(Parameter(
            "dead_pixels", "dead pixels, share", None, (None, None), "1", False,
            "cannot be known without a flat: a dark pixel may see a dark place",
            "a flat: --flat FLAT.dat",
        ))  # fmt: skip
    else:
        out.append(_share("dead", defects.dead, ", less than half the median response to light"))
    what = " fire in every cycle of the dimmest recording"
    return [*out, _share("stuck", defects.stuck, what)]


def _share(kind: str, marked: npt.NDArray[np.bool_], what: str) -> Parameter:
    """The share of the marked pixels. what: goes on after "3 of 100 pixels"."""
    count = int(marked.sum())
    share, ci = proportion(count, marked.size)
    why = f"{count} of {marked.size} pixels{what}"
    return Parameter(f"{kind}_pixels", f"{kind} pixels, share", share, ci, "1", True, why)


def _hot_current(defects: Defects, dark: Trains, fit: PatternFit, hertz: float) -> Parameter:
    """Mean current of hot pixels on top of the others'. Its error is that of the mean of pixels
    with the device's spreads, or with their own where it is larger."""
    from scipy.stats import t

    assert fit.dark is not None and fit.common is not None and fit.dark_spread is not None
    rate = dark_rates(dark)[defects.hot]
    x = rate / np.maximum(1 - rate * max(fit.dead or 0.0, 0.0), 1e-3)
    common = max(fit.common, 0.0)
    excess = float(x.mean()) / (1 + common) - fit.dark
    model = math.sqrt(
        max(fit.dark_spread - common, 0) * fit.dark**2 + common * float(x.mean()) ** 2
    )
    n, half = len(x), DEVIATIONS * model
    if n > 3:
        half = max(half, float(t.ppf(0.975, n - 1)) * float(x.std(ddof=1)))
    half = math.hypot(half / math.sqrt(n), DEVIATIONS * fit.error(1, 0, 0, 0, 0))
    bright = bool((rate > 0.9).any())
    return Parameter(
        "hot_current", "current of hot pixels on top, over the threshold, mean", excess * hertz,
        (max(excess - half, 0.0) * hertz, None if bright else (excess + half) * hertz), "1/s",
        not bright, "mean dark rate of the hot pixels less that of the others"
        + (", of which some fire in nearly every cycle" if bright else ""),
        "a higher threshold, or a cooler chip" if bright else "",
    )  # fmt: skip


def outside_parameters(has_light: bool) -> list[Parameter]:
    """What no spike recording tells."""
    out = [
        Parameter(
            "clock", "latch clock", None, (None, None), "Hz", False,
            "the recording counts cycles; rates in seconds take the clock stated",
            "the camera's data sheet: --clock '20 kHz'",
        ),
        Parameter(
            "quantum_efficiency", "quantum efficiency, fill factor and pitch", None, (None, None),
            "1", False, "light and its conversion to electrons are one factor",
            "a light meter at the pixel, and the threshold in electrons",
        ),
    ]  # fmt: skip
    if has_light:
        out.append(Parameter(
            "illuminance", "light of the flats in lux", None, (None, None), "lux", False,
            "as quantum efficiency", "a light meter",
        ))  # fmt: skip
    return out
