"""Flicker of a light waveform: percent flicker, flicker index, the class of IEEE Std 1789-2015, the
stroboscopic effect (SVM) and the visibility by elaTCSF, all from one spectrum.

Percent flicker is (max - min) / (max + min). The flicker index is the area above the mean over the
total area (both from the IES lighting handbook, over whole periods). IEEE 1789 limits the
modulation, in percent, depending on its frequency: see `LIMITS`.

SVM = (sum of (C_m / T(f_m))^3.7)^(1 / 3.7) over the components from 80 to 2000 Hz, where C_m is the
amplitude of a component over the mean and T the threshold contrast of a sine. Above 1, an average
observer perceives moving objects in steps; the EU limit for lamps is 0.4 (Regulation 2019/2020).
The method is that of IEC TR 63158, after Perz et al., Lighting Res. Technol. 47:281, 2015. No
citable source was found for the constants of T; with them, the threshold at 100 Hz is 0.26.

elaTCSF (Cai et al., SIGGRAPH Asia 2024) gives the sensitivity at a point of the visual field by
frequency, eccentricity and luminance, and pools it over the flickering area. It is defined for one
frequency; here the components of a waveform are combined as the root of the sum of squares, which
does not depend on the duration for noise. This combination is assumed.

The spectrum consists of components, each line with its leakage. The window is a Hann window. Bins
between two local minima of the spectrum form a group. By Parseval's theorem, the energy of a group
is that of its line, for any frequency between two bins (the main lobe of a Hann window has all but
0.05 % of it). Longer waveforms are cut into pieces of about one second, and their power spectra are
averaged, so that noise, which has no lines, is reported per about one hertz for any length of the
waveform. Lines less than about 4 Hz apart form one component.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from numba import njit

from display.observe.observers import DIMMEST, STAGE_TIME, STAGES, frequency_scale

Values = npt.NDArray[np.float64]
WINDOW: Final = 1.0
"""Length of a piece of a long waveform, s."""
STEADY: Final = 1e-12
"""Contrast below which a bin counts as rounding error."""
LEAST: Final = 16
"""Minimum number of samples of a waveform."""
Risk = Literal["no effect", "low risk", "high risk"]
EXEMPT: Final = 3000.0
"""Frequency from which modulation has no limit, Hz."""
LIMITS: Final = (
    (90.0, 0.01, 0.025),
    (1250.0, 0.0333, 0.08),
    (EXEMPT, 0.0333, math.inf),
)
"""(upper frequency, Hz; modulation without effect, %/Hz; modulation at low risk, %/Hz)."""
EXPONENT: Final = 3.7
LOWEST: Final = 80.0
SVM_HIGHEST: Final = 2000.0
"""Range of the components that count, Hz."""
LEAST_SECONDS: Final = 1.0
LEAST_RATE: Final = 4000.0
"""Minimum sampling rate, Hz: twice the highest component."""
KAPPA: Final = 2.12547
GAIN: Final = 154.133
ZETA: Final = 0.721095
FASTER: Final = 16
"""Number of stages of the second cascade of the temporal response."""
FADING: Final = 0.0330933
PEAK: Final = 1.76801
DIMMING: Final = 1.62402, 0.533781
"""Decrease of sensitivity with eccentricity (decades per degree), peak, and dependence on luminance
(cd/m2, exponent)."""
STRETCH: Final = 0.0341811, 2.0
"""Scale of frequencies with eccentricity: factor per degree, and offset, Hz."""
BETA: Final = 3.80022
AREA: Final = 6.52801
"""Exponent and unit area, square degrees, of the pooling over area."""
TCSF_HIGHEST: Final = 300.0
"""Frequency above which the sensitivity is 0, Hz."""
NODES: Final = 4, 24
"""Numbers of Gauss-Legendre nodes along each half of a field: up to one degree, and above."""


@dataclass(frozen=True)
class FlickerFigures:
    """Flicker of a light waveform.

    Attributes:
        mean: mean of the samples, in their unit.
        percent: percent flicker, %.
        index, svm, visibility: flicker index, SVM, and visibility by elaTCSF; dimensionless.
        ieee: class of IEEE 1789.
    """

    mean: float
    percent: float
    index: float
    svm: float
    visibility: float
    ieee: Ieee1789


def flicker_figures(
    wave: npt.ArrayLike, rate: float, luminance: float, field: tuple[float, float]
) -> FlickerFigures:
    """The flicker figures of a waveform.

    Args:
        wave: samples of light, at least one second (see `svm`).
        rate: sampling rate, Hz.
        luminance: luminance of the mean, cd/m2.
        field: (width, height) of the field that flickers in phase, degrees.

    Raises:
        ValueError: the waveform is too short or sampled too slowly.
    """
    light = waveform(wave)
    check_svm(len(light) / rate, rate)
    lines = spectrum(light, rate)
    return FlickerFigures(
        float(light.mean()), percent_flicker(light), flicker_index(light), svm_of(lines),
        tcsf_visibility_of(lines, luminance, field), ieee_1789_of(lines),
    )  # fmt: skip


def waveform(wave: npt.ArrayLike) -> Values:
    """The samples of light as (n,) float64. Raises ValueError unless there are at least LEAST
    samples, all finite and not negative, and not all zero."""
    light = np.asarray(wave, np.float64)
    if light.ndim != 1 or len(light) < LEAST:
        raise ValueError(f"a waveform must be {LEAST} or more samples, not {light.shape}")
    if not np.isfinite(light).all() or light.min() < 0 or light.max() == 0:
        raise ValueError("a waveform must be light: finite, never negative, not always 0")
    return light


def percent_flicker(wave: npt.ArrayLike) -> float:
    """Percent flicker 100 (max - min) / (max + min) of sampled light, %."""
    light = waveform(wave)
    return float(100 * (light.max() - light.min()) / (light.max() + light.min()))


def flicker_index(wave: npt.ArrayLike) -> float:
    """Flicker index, 0 to 1, of light sampled over whole periods."""
    light = waveform(wave)
    mean = light.mean()
    return float(np.maximum(light - mean, 0).mean() / mean)


@dataclass(frozen=True)
class Ieee1789:
    """Flicker of a display against the limits of IEEE Std 1789-2015.

    Attributes:
        frequency: dominant frequency, Hz.
        modulation: modulation at this frequency, %.
        no_effect, low_risk: limits at this frequency, %.
        risk: class.
    """

    frequency: float
    modulation: float
    no_effect: float
    low_risk: float
    risk: Risk


def risk_of(frequency: float, modulation: float) -> Ieee1789:
    """The class of a modulation, %, at a frequency, Hz."""
    no_effect = low_risk = math.inf
    for up_to, none, low in LIMITS:
        if frequency < up_to:
            no_effect, low_risk = none * frequency, low * frequency
            break
    risk: Risk = "high risk"
    if modulation <= no_effect:
        risk = "no effect"
    elif modulation <= low_risk:
        risk = "low risk"
    return Ieee1789(frequency, modulation, no_effect, low_risk, risk)


def ieee_1789_of(lines: Spectrum) -> Ieee1789:
    """The class of a spectrum of light, by its strongest component, whose amplitude over the mean
    is the modulation. For short pulses, which have harmonics, it exceeds 100 %. For noise, it is
    the energy in about one hertz (see `spectrum`)."""
    frequency, contrast = lines.components()
    k = int(np.argmax(contrast))
    return risk_of(float(frequency[k]), float(100 * contrast[k]))


def svm(wave: npt.ArrayLike, rate: float) -> float:
    """SVM of light sampled at `rate`, Hz. The leakage of a line is added to it before the power 3.7
    is computed (see `spectrum`). Raises ValueError for less than 1 s or 4000 Hz."""
    check_svm(np.size(wave) / rate, rate)
    return svm_of(spectrum(wave, rate))


def check_svm(seconds: float, rate: float) -> None:
    """Raises ValueError for a waveform of less than 1 s, or a sampling rate below 4000 Hz."""
    if seconds < LEAST_SECONDS * (1 - 1e-9) or rate < LEAST_RATE:
        raise ValueError(
            f"SVM needs at least {LEAST_SECONDS:g} s sampled at {LEAST_RATE:g} Hz or more, not "
            f"{seconds:g} s at {rate:g} Hz"
        )


def svm_of(lines: Spectrum) -> float:
    """SVM of a spectrum."""
    gain = _svm_gains(len(lines.frequency), float(lines.frequency[1]))
    frequency, visible = lines.components(gain)
    counts = (frequency >= LOWEST) & (frequency <= SVM_HIGHEST)
    return float((visible[counts] ** EXPONENT).sum() ** (1 / EXPONENT))


def svm_threshold(frequency: npt.ArrayLike) -> Values:
    """T(f), the contrast of a sine whose stroboscopic effect is just visible, for f in Hz."""
    f = np.asarray(frequency, np.float64)
    return 1 / (1 + np.exp(-0.00518 * (f - 306.6))) + 20 * np.exp(-f / 10)


@lru_cache(maxsize=4)
def _svm_gains(bins: int, step: float) -> Values:
    """1 / T(f) at the bins of a spectrum, `step` Hz apart."""
    return 1 / svm_threshold(np.arange(bins) * step)


def tcsf_visibility_of(lines: Spectrum, luminance: float, field: tuple[float, float]) -> float:
    """Flicker over its threshold; above 1 it is visible.

    Args:
        lines: spectrum of the light.
        luminance: mean luminance, cd/m2.
        field: (width, height) of the field that flickers in phase, degrees.
    """
    gain = _tcsf_gains(len(lines.frequency), float(lines.frequency[1]), luminance, field)
    return float(np.sqrt((lines.energy[: len(gain)] * gain**2).sum()))


def tcsf(frequency: npt.ArrayLike, eccentricity: npt.ArrayLike, luminance: float) -> Values:
    """Sensitivity (1 / threshold contrast) at a point of the visual field, before pooling over
    area.

    Args:
        frequency: frequency of the flicker, Hz.
        eccentricity: distance from the centre of the visual field, degrees.
        luminance: mean luminance, cd/m2.
    """
    f, e = np.asarray(frequency, np.float64), np.asarray(eccentricity, np.float64)
    lit = max(luminance, DIMMEST)
    per, offset = STRETCH
    scaled = (f + offset) / (1 + per * e) - offset
    turn = 2 * np.pi * scaled / frequency_scale(lit) * STAGE_TIME
    response = np.abs(_cascade(turn, STAGES) - ZETA * _cascade(KAPPA * turn, FASTER))
    bright = PEAK * (1 + DIMMING[0] / lit) ** -DIMMING[1]
    return np.asarray(10 ** (-FADING * e) * bright * GAIN * response)


def sensitivity(
    frequency: npt.ArrayLike, luminance: float, field: tuple[float, float]
) -> npt.NDArray[np.float64]:
    """Sensitivity, (n,), to a field that flickers in phase, fixated at its centre.

    Args:
        frequency: frequencies, Hz, (n,).
        luminance: mean luminance, cd/m2.
        field: (width, height) of the field, degrees.

    Raises:
        ValueError: the field is empty.
    """
    width, height = field
    if not (width > 0 and height > 0):
        raise ValueError(f"field must be wider and higher than 0 degrees, not {width} x {height}")
    node, weight = np.polynomial.legendre.leggauss(NODES[int(max(field) > 1)])
    x, y = (node + 1) * width / 4, (node + 1) * height / 4
    apart = np.hypot(x[:, None], y[None, :]).ravel()
    area = (weight[:, None] * weight[None, :]).ravel() * width * height / 4
    f = np.atleast_1d(np.asarray(frequency, np.float64))
    pooled = tcsf(f[:, None], apart[None, :], luminance) ** BETA @ area / AREA
    return np.asarray(pooled ** (1 / BETA))


@lru_cache(maxsize=32)
def _tcsf_gains(bins: int, step: float, luminance: float, field: tuple[float, float]) -> Values:
    """Sensitivity at the bins of a spectrum up to TCSF_HIGHEST; flicker far above the critical
    frequency is not visible."""
    return sensitivity(np.arange(min(bins, int(TCSF_HIGHEST / step) + 1)) * step, luminance, field)


def _cascade(turn: Values, stages: int) -> npt.NDArray[np.complex128]:
    """(1 + i turn)^-stages, by magnitude and phase: complex powers take ten times as long."""
    return np.asarray((1 + turn**2) ** (-stages / 2) * np.exp(-1j * stages * np.arctan(turn)))


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Contrast energy of a waveform over frequency.

    Attributes:
        frequency: frequency of each bin, Hz, (bins,).
        energy: energy of each bin as squared contrast, (bins,): a sine of contrast c (amplitude
            over mean) has c² over its bins.
        group: number of the component of each bin, (bins,).
    """

    frequency: Values
    energy: Values
    group: npt.NDArray[np.int64]

    def components(self, gain: npt.ArrayLike = 1.0) -> tuple[Values, Values]:
        """The frequency of the strongest bin, Hz, and the contrast of each component. `gain`:
        factor on the contrast of each bin, (bins,)."""
        gains = np.full(self.energy.shape, gain, np.float64)
        total, strongest = _components(self.energy, gains, self.group)
        return self.frequency[strongest], np.sqrt(total)


def spectrum(wave: npt.ArrayLike, rate: float) -> Spectrum:
    """The spectrum of light sampled at `rate`, Hz, relative to its mean. Raises ValueError."""
    if not rate > 0:
        raise ValueError(f"sampling rate must be positive, not {rate:g} Hz")
    light = waveform(wave)
    pieces = max(int(len(light) / (rate * WINDOW) + 1e-9), 1)
    length = len(light) // pieces
    parts = light[: pieces * length].reshape(pieces, length)
    window = _hann(length)
    # The mean under the window is subtracted, because it would leak into the lowest bins.
    level = (parts * window).sum(axis=1) / window.sum()
    power = np.abs(np.fft.rfft((parts - level[:, None]) * window)) ** 2
    scale = 4 / (length * (window**2).sum()) / light.mean() ** 2
    energy = power.mean(axis=0) * scale
    energy[energy < STEADY**2] = 0.0
    energy[0] = 0.0
    lows = np.flatnonzero((energy[1:-1] < energy[:-2]) & (energy[1:-1] <= energy[2:])) + 1
    group = np.zeros(len(energy), np.int64)
    group[lows] = 1
    frequency = np.arange(len(energy), dtype=np.float64) * (rate / length)
    return Spectrum(frequency, energy, np.cumsum(group))


@njit(cache=True, nogil=True)
def _components(energy, gain, group):  # type: ignore[no-untyped-def]
    """The energy of each component, (components,), and its strongest bin, the first of equal
    ones."""
    total = np.zeros(group[-1] + 1)
    strongest = np.zeros(len(total), np.int64)
    last = -1
    for k in range(len(energy)):
        at = group[k]
        total[at] += energy[k] * gain[k] ** 2
        if at != last or energy[k] > energy[strongest[at]]:
            strongest[at] = k
        last = at
    return total, strongest


@lru_cache(maxsize=4)
def _hann(length: int) -> Values:
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
    window.flags.writeable = False
    return window
