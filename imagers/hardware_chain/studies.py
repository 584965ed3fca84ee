"""The hardware chain in `viform compare`: the timed exposure that document 000 contrasts with pulse
modulation."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

from imagers.common.kind import Comparison, Setting
from imagers.hardware_chain.model import HardwareChainModel
from imagers.hardware_chain.section import HardwareChainSection

FULL: Final = 0.8
"""Share of saturation that white fills."""
LONGEST: Final = 0.04
"""Longest exposure that is chosen, s."""
SHORTEST: Final = 1e-6
"""Shortest exposure of a section, s."""


class HardwareChainComparison(Comparison):
    """See `Comparison`. Unless given, the sensor is the 3T one, of 10 fF and 1 V: the pixel of the
    pulse-modulated imagers that it stands beside."""

    title = "timed exposure, hardware chain"

    def keys(self, shape: tuple[int, int]) -> dict[str, Any]:
        return super().keys(shape) | {
            "sensor": "cmos-3t", "pitch": "10 um", "quantum_efficiency": 0.7
        }  # fmt: skip

    def adjust(
        self, section: HardwareChainSection, white: float, mean: float, given: frozenset[str]
    ) -> HardwareChainSection:
        """The exposure at which white fills a share of saturation, up to the longest."""
        if "exposure" in given:
            return section
        model = HardwareChainModel(section)
        full = FULL * model.chain.saturation / (white * model.pixels.responsivity)
        return section.model_copy(update={"exposure": max(min(full, LONGEST), SHORTEST)})

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        """Exposures from the shortest to the longest, at the gains that are set."""
        return Setting(pixels, SHORTEST), Setting(replace(pixels, exposure=LONGEST), LONGEST)

    def setting(self, section: HardwareChainSection, pixels: Any) -> str:
        name = section.sensor if section.own_sensor is None else section.own_sensor.name
        gain = math.prod((section.analog_gain, section.digital_gain))
        return f"{name}, {pixels.bits} bits, gain {gain:g}"
