"""Pulse-modulated imagers with the settings of a scenario, and their rows in `viform compare`,
where their threshold is set for the light.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.light.radiometry import photons_per_lux
from cosim.run.result import Latency, Metric
from imagers.common.fixed import FixedExposure, FixedTiming
from imagers.common.kind import Comparison, Setting
from imagers.common.model import ExposureRange, FrameFigures, ImagerModel, View, read_latency
from imagers.pulse.pixels import PfmPixels, PulsePixels, PwmPixels
from imagers.pulse.section import PulseSection
from sensor.dynamic_range import decibels

_KINDS: Final[dict[str, tuple[type[PulsePixels], int]]] = {
    "pwm": (PwmPixels, 32),
    "pfm": (PfmPixels, 1),
}
"""Pixels, and the parts of an exposure between which the light's course is linear: a width tells
when the light came, a count does not."""
_LEVELS: Final = 1 << 16
"""Value of white on a display."""
THRESHOLDS: Final = (100.0, 62_400.0)
"""Range of the threshold, e: assumed, and the whole swing of 10 fF and 1 V."""
DARKEST: Final = 0.02
"""Reflectance that still reaches the threshold of a pulse width within the exposure."""
MARGIN: Final = 6.0
"""Standard deviations of its charge and reset by which it does, so that noise leaves no pixel
without a pulse."""
FULL: Final = 0.8
"""Share of its most pulses that white makes in pulse frequency."""


@dataclass(frozen=True)
class PulseModel(ImagerModel):
    """See `ImagerModel`."""

    section: PulseSection

    @property
    def shape(self) -> tuple[int, int]:
        return self.section.rows, self.section.columns

    @cached_property
    def timing(self) -> FixedTiming:
        s = self.section
        return FixedTiming.of(self.shape, s.clock, s.exposure, s.frame_rate, rolling=False)

    @cached_property
    def pixels(self) -> Any:
        s = self.section
        return _KINDS[s.kind][0](
            self.shape, s.threshold, s.exposure, s.shortest, s.bits, s.reset_noise,
            s.dark_current, photons_per_lux() * (s.pitch * 1e-6) ** 2 * s.quantum_efficiency,
        )  # fmt: skip

    def make(self) -> FixedExposure:
        kind = self.section.kind
        return FixedExposure(kind, self.pixels, self.timing, _KINDS[kind][1])

    def exposures(self, view: View, stop: int) -> ExposureRange:
        seconds = self.section.exposure
        light = float(view.least.min()) * seconds, float(view.most.max()) * seconds
        return ExposureRange(light, (seconds, seconds), self.timing.frames(stop))

    def metrics(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> dict[str, Metric]:
        least, most = self.pixels.light_range(self.section.exposure)
        return {
            "dynamic_range_formula": Metric(decibels(most / least), "dB"),
            "largest_value": Metric(float(np.mean([frame.full for frame in frames])), "1"),
            "mean": Metric(frames[-1].mean, "DN"),
        }

    def notes(self, frames: Sequence[FrameFigures]) -> list[str]:
        unreached = (0, 0) if self.section.kind == "pfm" else (self.pixels.full,) * 2
        if not frames or any((frame.least, frame.most) != unreached for frame in frames):
            return []
        return ["no pixel reached the threshold: lower imager.threshold or give more light"]

    def latency(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> list[Latency]:
        return read_latency(frames)

    def levels(
        self, values: npt.NDArray[np.uint16], bits: int, white: float
    ) -> tuple[npt.NDArray[np.int64], int]:
        """The light that a width or a number of pulses means, with the scene's white as white."""
        light = self.pixels.lux(values) * (_LEVELS / max(white, 1e-300))
        return np.rint(np.minimum(light, 2.0**40)).astype(np.int64), _LEVELS


class _PulseComparison(Comparison):
    """What both have; see `Comparison`."""

    def adjust(
        self, section: PulseSection, white: float, mean: float, given: frozenset[str]
    ) -> PulseSection:
        """The threshold that the light asks for, within its range."""
        if "threshold" in given:
            return section
        pixels = PulseModel(section).pixels
        wanted = self.wanted(pixels, white * pixels.responsivity * section.exposure)
        low, high = THRESHOLDS
        return section.model_copy(update={"threshold": round(min(max(wanted, low), high))})

    def wanted(self, pixels: Any, electrons: float) -> float:
        """Threshold for white of so many electrons in an exposure."""
        raise NotImplementedError

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        low, high = (replace(pixels, threshold=q) for q in THRESHOLDS)
        return Setting(high, pixels.exposure), Setting(low, pixels.exposure)

    def setting(self, section: PulseSection, pixels: Any) -> str:
        return f"threshold {pixels.threshold:g} e, {pixels.bits} bits"


class PwmComparison(_PulseComparison):
    """See `Comparison`. Dark pixels need a large threshold least."""

    title = "pulse-width modulation"

    def wanted(self, pixels: Any, electrons: float) -> float:
        charge = DARKEST * electrons
        return charge - MARGIN * math.hypot(math.sqrt(charge), pixels.reset)


class PfmComparison(_PulseComparison):
    """See `Comparison`."""

    title = "pulse-frequency modulation"

    def keys(self, shape: tuple[int, int]) -> dict[str, Any]:
        return super().keys(shape) | {"bits": 10}

    def wanted(self, pixels: Any, electrons: float) -> float:
        return electrons / (FULL * pixels.most)
