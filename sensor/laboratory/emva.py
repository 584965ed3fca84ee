"""A camera measured in the manner of EMVA 1288 (release 4.0, linear), each figure with limits.

What differs from the standard: slopes are weighted by the inverse variance of their points, stacks
have more than two frames, light is monochromatic at 555 nm by this project's convention, and no
high-pass filter is needed because the light is uniform.

What a gain with noise of its own does to it: electrons multiplied by G with excess noise factor
F^2 have the variance K G (G F^2) a photoelectron over the mean K G, so photon transfer measures
K G F^2 and finds the quantum efficiency QE/F^2: gain and efficiency of an EMCCD at high gain or of
an EBAPS are to be read so.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from sensor.dynamic_range import decibels
from sensor.laboratory.bench import LEAST_VARIANCE, Bench, Stack
from sensor.laboratory.transfer import Estimate, PhotonTransfer, deviations, measure_transfer

LEVEL = 0.99
"""Level of the confidence limits."""
SENSITIVITY, LINEARITY = "sensitivity", "linearity"
DARK_CURRENT, NON_UNIFORMITY = "dark current", "non-uniformity"
QUANTISATION = 1 / 12
"""DN^2 of rounding to whole DN."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of the standard.

    Attributes:
        symbol: symbol of the standard.
        section: "sensitivity", "linearity", "dark current" or "non-uniformity", the parts in which
            the standard measures.
        what: its name.
        unit: unit of the value.
        value: measured.
        low, high: confidence limits at `LEVEL`.
    """

    symbol: str
    section: str
    what: str
    unit: str
    value: float
    low: float
    high: float

    def holds(self, truth: float) -> bool:
        """Whether a value lies within the limits."""
        return self.low <= truth <= self.high


@dataclass(frozen=True, eq=False)
class Report:
    """The measurement of a camera.

    Attributes:
        figures: parameters by name.
        transfer: the curve that they come from.
        notes: what a reader must know.
        level: level of the confidence limits.
    """

    figures: dict[str, Parameter]
    transfer: PhotonTransfer
    notes: tuple[str, ...]
    level: float = LEVEL

    def __getitem__(self, name: str) -> Parameter:
        return self.figures[name]

    def rows(self) -> list[dict[str, str | float]]:
        """For a table or a document: {name, symbol, section, what, unit, value, low, high}."""
        return [{"name": name, **asdict(figure)} for name, figure in self.figures.items()]


def _parameter(symbol: str, section: str, what: str, unit: str, estimate: Estimate) -> Parameter:
    return Parameter(symbol, section, what, unit, estimate.value, *estimate.limits(LEVEL))


def _deviation(
    symbol: str, section: str, what: str, unit: str, squared: Estimate, scale: float = 1.0
) -> Parameter:
    """The root of a variance; limits are the roots of its own, not below zero."""
    low, high = squared.limits(LEVEL)
    roots = (scale * math.sqrt(max(v, 0.0)) for v in (squared.value, low, high))
    return Parameter(symbol, section, what, unit, *roots)


def _dark_current(bench: Bench) -> tuple[Estimate, Estimate]:
    """Slopes of mean and variance in the dark over exposure time: DN/s and DN^2/s."""
    stacks = [bench.unlit(t) for t in bench.dark_seconds]
    t = np.array(bench.dark_seconds)
    share = (t - t.mean()) / ((t - t.mean()) ** 2).sum()

    def slope(name: str) -> Estimate:
        rise = sum(w * getattr(s, name) for w, s in zip(share, stacks, strict=True))
        return Estimate.mean(np.asarray(rise))

    return slope("mean"), slope("variance")


def _linearity(transfer: PhotonTransfer) -> Parameter:
    """Mean of the deviations from a straight line, relative to it, over 5 to 95 % of saturation;
    the line is fitted with weights of 1/y^2, so that relative deviations count alike. The limits
    hold for any correlation of the levels."""
    dark, end = transfer.dark, transfer.saturated_photons
    used = [s for s in transfer.levels if 0.05 * end <= s.photons <= 0.95 * end]
    x = np.array([s.photons for s in used]) - dark.photons
    y = [Estimate.mean(s.mean - dark.mean) for s in used]
    weight = 1 / np.array([v.value for v in y]) ** 2
    middle = (weight * x).sum() / weight.sum()
    spread = (weight * (x - middle) ** 2).sum()
    value = np.array([v.value for v in y])
    influence = np.stack([v.influence for v in y])

    def line(values: np.ndarray) -> np.ndarray:
        level = np.tensordot(weight, values, 1) / weight.sum()
        slope = np.tensordot(weight * (x - middle), values, 1) / spread
        return np.asarray(level + np.multiply.outer(x - middle, slope))

    fit = line(value)
    off, errors = (value - fit) / fit, (influence - line(influence))
    wide = [Estimate(0.0, e / f).deviation for e, f in zip(errors, fit, strict=True)]
    estimate = float(np.abs(off).mean())
    half = deviations(LEVEL) * float(np.mean(wide))
    return Parameter(
        "LE",
        LINEARITY,
        "linearity error",
        "%",
        100 * estimate,
        100 * max(estimate - half, 0),
        100 * (estimate + half),
    )


def _patterns(
    half: Stack, dark: Stack, gain: Estimate, response: Estimate
) -> tuple[Parameter, Parameter]:
    """DSNU and PRNU. Under a bias, PRNU's share of it is in both stacks."""
    in_dark, in_light = Estimate.mean(dark.spatial), Estimate.mean(half.spatial)
    bias = response * dark.photons
    signal = Estimate.mean(half.mean - dark.mean) + bias
    prnu = (in_light - in_dark) / (signal * signal - bias * bias)
    dsnu = (in_dark - prnu * bias * bias) / (gain * gain)
    return (
        _deviation("DSNU", NON_UNIFORMITY, "dark signal non-uniformity", "e", dsnu),
        _deviation("PRNU", NON_UNIFORMITY, "photo response non-uniformity", "%", prnu, 100),
    )


def measure_camera(bench: Bench) -> Report:
    """All figures of a camera, by name: gain, responsivity, quantum_efficiency, dark_noise,
    dark_current, dark_current_variance, dsnu, prnu, saturation_photons, saturation_electrons,
    least_photons, snr_max, dynamic_range, linearity_error."""
    transfer = measure_transfer(bench)
    gain, response, dark = transfer.gain, transfer.responsivity, transfer.dark
    measured = Estimate.mean(dark.variance)
    # What the bias adds of shot noise is K times its signal.
    noise = measured - gain * response * dark.photons
    notes = []
    if dark.photons:
        notes.append(
            f"a bias of {dark.photons:.4g} photons shone in the dark; its share is taken off"
        )
    elif noise.value < LEAST_VARIANCE:
        notes.append(
            f"noise in the dark is {noise.value:.2g} DN^2, below {LEAST_VARIANCE}: rounding hides "
            "it, and dark noise and least signal are upper limits"
        )
        noise = Estimate(LEAST_VARIANCE, 0 * noise.influence)
    efficiency = response / gain
    rise, spread = _dark_current(bench)
    half = bench.take(transfer.saturated_photons / 2, bench.seconds, bench.stack)
    unlit = dark if bench.dark_bias is None else bench.unlit(bench.seconds)
    dsnu, prnu = _patterns(half, unlit, gain, response)
    # sigma_d/K + 1/2 electrons, in photons; sigma_d with rounding in it.
    # Rounding alone is 1/12, so nothing less can be meant.
    deviation = math.sqrt(max(noise.value, QUANTISATION))
    root = noise.through(deviation, 0.5 / deviation)
    least = (root / gain + 0.5) / efficiency
    full, (low, high) = transfer.saturated_photons, transfer.saturated_between
    few, many = efficiency.limits(LEVEL)
    bottom = least.limits(LEVEL)
    electrons = (efficiency.value * full, few * low, many * high)
    figures = {
        "gain": _parameter("K", SENSITIVITY, "overall system gain", "DN/e", gain),
        "responsivity": _parameter("R", SENSITIVITY, "responsivity", "DN/photon", response),
        "quantum_efficiency": _parameter("eta", SENSITIVITY, "quantum efficiency", "1", efficiency),
        "dark_noise": _deviation(
            "sigma_d", SENSITIVITY, "temporal dark noise", "e",
            (noise - QUANTISATION) / (gain * gain),
        ),
        "saturation_photons": Parameter(
            "mu_p.sat", SENSITIVITY, "saturation capacity", "photon", full, low, high
        ),
        "saturation_electrons": Parameter(
            "mu_e.sat", SENSITIVITY, "saturation capacity", "e", *electrons
        ),
        "least_photons": _parameter(
            "mu_p.min", SENSITIVITY, "absolute sensitivity threshold", "photon", least
        ),
        "snr_max": Parameter(
            "SNR_max", SENSITIVITY, "largest signal-to-noise ratio", "1", *map(math.sqrt, electrons)
        ),
        "dynamic_range": Parameter(
            "DR", SENSITIVITY, "dynamic range", "dB", decibels(full / least.value),
            decibels(low / bottom[1]), decibels(high / max(bottom[0], 1e-12)),
        ),
        "linearity_error": _linearity(transfer),
        "dark_current": _parameter(
            "mu_I", DARK_CURRENT, "dark current, of the mean", "e/s", rise / gain
        ),
        "dark_current_variance": _parameter(
            "mu_I,var", DARK_CURRENT, "dark current, of the variance", "e/s", spread / (gain * gain)
        ),
        "dsnu": dsnu,
        "prnu": prnu,
    }  # fmt: skip
    return Report(figures, transfer, tuple(notes))
