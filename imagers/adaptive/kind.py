"""The catalogue entry of the adaptive-exposure sensor.

The methods import what they need, because the physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from imagers.adaptive.section import AdaptiveSection
from imagers.common.kind import ImagerKind

if TYPE_CHECKING:
    from cosim.run.printed import PrintedRow
    from imagers.adaptive.model import AdaptiveModel
    from imagers.common.kind import Comparison
    from imagers.common.model import ImagerModel
    from imagers.common.registers import BusTarget
    from imagers.report.page import ImagerRun
    from rtl_model.registers.design import Design
    from sensor.laboratory.cameras import Camera


class AdaptiveKind(ImagerKind):
    """See `ImagerKind`."""

    name = "adaptive-exposure"
    title = "adaptive-exposure CMOS sensor"
    section = AdaptiveSection
    number = 1
    document = ("001", "CMOS image sensor with wide dynamic range and adaptive exposure")

    def model(self, section: AdaptiveSection, seconds: float) -> ImagerModel:
        from imagers.adaptive.model import AdaptiveModel

        return AdaptiveModel(section)

    def design(self) -> Design:
        from imagers.adaptive.device.registers import DESIGN

        return DESIGN

    def bus_target(self) -> BusTarget:
        from imagers.adaptive.device.controller import bus_target

        return bus_target()

    def comparison(self) -> Comparison:
        from imagers.adaptive.model import AdaptiveComparison

        return AdaptiveComparison()

    def measured(self) -> Camera:
        from imagers.adaptive.model import MEASURED

        return MEASURED

    def sections(self, model: AdaptiveModel, run: ImagerRun) -> str:
        from imagers.adaptive.pages import adaptive_sections

        return adaptive_sections(model, run)

    def printed(self) -> list[PrintedRow]:
        from imagers.adaptive.paper import adaptive_rows

        return adaptive_rows()
