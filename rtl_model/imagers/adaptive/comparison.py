"""The adaptive-exposure sensor in `viform compare`; it chooses its exposure itself."""

from __future__ import annotations

from typing import Any

from rtl_model.imagers.adaptive.device.loop import shortest_exposure
from rtl_model.imagers.adaptive.device.registers import DEFAULT_LONGEST
from rtl_model.imagers.adaptive.device.response import longest_exposure
from rtl_model.imagers.adaptive.section import AdaptiveSection
from rtl_model.imagers.interface.comparison import Comparison, Setting

__all__ = ["AdaptiveComparison"]


class AdaptiveComparison(Comparison):
    """See `Comparison`."""

    title = "adaptive-exposure CMOS"

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        return (
            Setting(pixels, shortest_exposure()),
            Setting(pixels, longest_exposure(DEFAULT_LONGEST)),
        )

    def setting(self, section: AdaptiveSection, pixels: Any) -> str:
        return "chosen by itself"
