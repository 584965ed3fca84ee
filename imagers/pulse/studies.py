"""Pulse-modulated imagers in `viform compare`: their threshold is set for the light."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

from imagers.common.kind import Comparison, Setting
from imagers.pulse.model import PulseModel
from imagers.pulse.section import PulseSection

THRESHOLDS: Final = (100.0, 62_400.0)
"""Range of the threshold, e: assumed, and the whole swing of 10 fF and 1 V."""
DARKEST: Final = 0.02
"""Reflectance that still reaches the threshold of a pulse width within the exposure."""
MARGIN: Final = 6.0
"""Standard deviations of its charge and reset by which it does, so that noise leaves no pixel
without a pulse."""
FULL: Final = 0.8
"""Share of its most pulses that white makes in pulse frequency."""


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
