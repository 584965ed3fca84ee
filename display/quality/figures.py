"""All flicker figures of one waveform, from one spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy.typing as npt

from display.quality.flicker import Ieee1789, flicker_index, ieee_1789_of, percent_flicker
from display.quality.spectrum import spectrum, waveform
from display.quality.svm import check_svm, svm_of
from display.quality.tcsf import tcsf_visibility_of

__all__ = ["FlickerFigures", "flicker_figures"]


@dataclass(frozen=True)
class FlickerFigures:
    """Flicker of a light waveform.

    Attributes:
        mean: of the samples, in their unit.
        percent: percent flicker, %.
        index, svm, visibility: flicker index, SVM, and visibility by elaTCSF; dimensionless.
        ieee: class by IEEE 1789.
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
    """Of light sampled `rate` times a second for at least a second (see `svm`).

    Args:
        luminance: cd/m2 of its mean.
        field: degrees that flicker as one, (width, height).
    """
    light = waveform(wave)
    check_svm(len(light) / rate, rate)
    lines = spectrum(light, rate)
    return FlickerFigures(
        float(light.mean()), percent_flicker(light), flicker_index(light), svm_of(lines),
        tcsf_visibility_of(lines, luminance, field), ieee_1789_of(lines),
    )  # fmt: skip
