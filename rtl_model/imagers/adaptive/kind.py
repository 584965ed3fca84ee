"""The catalogue entry of the adaptive-exposure sensor.

The methods import what they need, because its physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtl_model.imagers.adaptive.section import AdaptiveSection
from rtl_model.imagers.interface.kind import ImagerKind

if TYPE_CHECKING:
    from cosim.run.printed import Row
    from rtl_model.imagers.adaptive.model import AdaptiveModel
    from rtl_model.imagers.device.bus import BusTarget
    from rtl_model.imagers.interface.comparison import Comparison
    from rtl_model.imagers.interface.model import ImagerModel
    from rtl_model.imagers.report.imager_run import ImagerRun
    from rtl_model.registers.design import Design

__all__ = ["AdaptiveKind"]


class AdaptiveKind(ImagerKind):
    """See `ImagerKind`."""

    name = "adaptive-exposure"
    title = "adaptive-exposure CMOS sensor"
    section = AdaptiveSection
    number = 1
    document = ("001", "CMOS image sensor with wide dynamic range and adaptive exposure")

    def model(self, section: AdaptiveSection, seconds: float) -> ImagerModel:
        from rtl_model.imagers.adaptive.model import AdaptiveModel

        return AdaptiveModel(section)

    def design(self) -> Design:
        from rtl_model.imagers.adaptive.device.registers import DESIGN

        return DESIGN

    def bus_target(self) -> BusTarget:
        from rtl_model.imagers.adaptive.device.bus_target import bus_target

        return bus_target()

    def comparison(self) -> Comparison:
        from rtl_model.imagers.adaptive.comparison import AdaptiveComparison

        return AdaptiveComparison()

    def sections(self, model: AdaptiveModel, run: ImagerRun) -> str:
        from rtl_model.imagers.adaptive.pages import adaptive_sections

        return adaptive_sections(model, run)

    def printed(self) -> list[Row]:
        from rtl_model.imagers.adaptive.paper import adaptive_rows

        return adaptive_rows()
