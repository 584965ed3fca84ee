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
from sensor.laboratory.estimate import Estimate, deviations
from sensor.laboratory.transfer import PhotonTransfer, measure_transfer

__all__ = ["LEVEL", "Measured", "Report", "measure_camera"]

LEVEL = 0.99
"""Of the confidence limits."""
QUANTISATION = 1 / 12
"""DN^2 of rounding to whole DN."""


@dataclass(frozen=True)
class Measured:
    """One figure. symbol: the standard's. low, high: confidence limits at `LEVEL`."""

    symbol: str
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
    """figures: by name. transfer: the curve that they come from. notes: what a reader must know."""

    figures: dict[str, Measured]
    transfer: PhotonTransfer
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> Measured:
        return self.figures[name]

    def rows(self) -> list[dict[str, str | float]]:
        """For a table or a document: {name, symbol, what, unit, value, low, high}."""
        return [{"name": name, **asdict(figure)} for name, figure in self.figures.items()]


def _plain(symbol: str, what: str, unit: str, found: Estimate) -> Measured:
    return Measured(symbol, what, unit, found.value, *found.limits(LEVEL))


def _root(symbol: str, what: str, unit: str, squared: Estimate, scale: float = 1.0) -> Measured:
    """The root of a variance; limits are the roots of its own, not below zero."""
    low, high = squared.limits(LEVEL)
    roots = (scale * math.sqrt(max(v, 0.0)) for v in (squared.value, low, high))
    return Measured(symbol, what, unit, *roots)


def _dark_current(bench: Bench) -> tuple[Estimate, Estimate]:
    """Slopes of mean and variance in the dark over exposure time: DN/s and DN^2/s."""
    stacks = [bench.dark(t) for t in bench.dark_seconds]
    t = np.array(bench.dark_seconds)
    share = (t - t.mean()) / ((t - t.mean()) ** 2).sum()

    def slope(name: str) -> Estimate:
        rise = sum(w * getattr(s, name) for w, s in zip(share, stacks, strict=True))
        return Estimate.mean(np.asarray(rise))

    return slope("mean"), slope("variance")


def _linearity(transfer: PhotonTransfer) -> Measured:
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
    found = float(np.abs(off).mean())
    half = deviations(LEVEL) * float(np.mean(wide))
    return Measured(
        "LE", "linearity error", "%", 100 * found, 100 * max(found - half, 0), 100 * (found + half)
    )


def _patterns(
    half: Stack, dark: Stack, gain: Estimate, response: Estimate
) -> tuple[Measured, Measured]:
    """DSNU and PRNU. Under a bias, PRNU's share of it is in both stacks."""
    in_dark, in_light = Estimate.mean(dark.spatial), Estimate.mean(half.spatial)
    bias = response * dark.photons
    signal = Estimate.mean(half.mean - dark.mean) + bias
    prnu = (in_light - in_dark) / (signal * signal - bias * bias)
    dsnu = (in_dark - prnu * bias * bias) / (gain * gain)
    return (
        _root("DSNU", "dark signal non-uniformity", "e", dsnu),
        _root("PRNU", "photo response non-uniformity", "%", prnu, 100),
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
    dsnu, prnu = _patterns(half, dark, gain, response)
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
        "gain": _plain("K", "overall system gain", "DN/e", gain),
        "responsivity": _plain("R", "responsivity", "DN/photon", response),
        "quantum_efficiency": _plain("eta", "quantum efficiency", "1", efficiency),
        "dark_noise": _root(
            "sigma_d", "temporal dark noise", "e", (noise - QUANTISATION) / (gain * gain)
        ),
        "dark_current": _plain("mu_I", "dark current, of the mean", "e/s", rise / gain),
        "dark_current_variance": _plain(
            "mu_I,var", "dark current, of the variance", "e/s", spread / (gain * gain)
        ),
        "dsnu": dsnu,
        "prnu": prnu,
        "saturation_photons": Measured(
            "mu_p.sat", "saturation capacity", "photon", full, low, high
        ),
        "saturation_electrons": Measured("mu_e.sat", "saturation capacity", "e", *electrons),
        "least_photons": _plain("mu_p.min", "absolute sensitivity threshold", "photon", least),
        "snr_max": Measured(
            "SNR_max", "largest signal-to-noise ratio", "1", *map(math.sqrt, electrons)
        ),
        "dynamic_range": Measured(
            "DR", "dynamic range", "dB", decibels(full / least.value), decibels(low / bottom[1]),
            decibels(high / max(bottom[0], 1e-12)),
        ),
        "linearity_error": _linearity(transfer),
    }  # fmt: skip
    return Report(figures, transfer, tuple(notes))
