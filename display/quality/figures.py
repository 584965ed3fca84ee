"""All flicker figures of a waveform, from one spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy.typing as npt

from display.quality.flicker import Ieee1789, flicker_index, ieee_1789_of, percent_flicker
from display.quality.spectrum import spectrum, waveform
from display.quality.svm import check_svm, svm_of
from display.quality.tcsf import tcsf_visibility_of


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
