"""The catalogue entry of the EMCCD.

The methods import what they need, because the physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from imagers.common.kind import ImagerKind
from imagers.emccd.section import EmccdSection

if TYPE_CHECKING:
    from cosim.run.printed import PrintedRow
    from imagers.common.kind import Comparison
    from imagers.common.model import ImagerModel
    from imagers.common.registers import BusTarget
    from imagers.emccd.model import EmccdModel
    from imagers.report.page import ImagerRun
    from rtl_model.registers.design import Design
    from sensor.laboratory.cameras import Camera


class EmccdKind(ImagerKind):
    """See `ImagerKind`."""

    name = "emccd"
    title = "frame-transfer EMCCD"
    section = EmccdSection
    number = 3
    document = (
        "003",
        "Wang, Li, Ye, four drive modes of a frame-transfer electron-multiplying CCD",
    )

    def model(self, section: EmccdSection, seconds: float) -> ImagerModel:
        from imagers.emccd.model import EmccdModel

        return EmccdModel(section, seconds)

    def design(self) -> Design:
        from imagers.emccd.device.controller import DESIGN

        return DESIGN

    def bus_target(self) -> BusTarget:
        from imagers.emccd.device.controller import bus_target

        return bus_target()

    def comparison(self) -> Comparison:
        from imagers.emccd.model import EmccdComparison

        return EmccdComparison()

    def measured(self) -> Camera:
        from imagers.emccd.model import MEASURED

        return MEASURED

    def sections(self, model: EmccdModel, run: ImagerRun) -> str:
        from imagers.emccd.pages import emccd_sections

        return emccd_sections(model, run)

    def printed(self) -> list[PrintedRow]:
        from imagers.emccd.paper import emccd_rows

        return emccd_rows()
