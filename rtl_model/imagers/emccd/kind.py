"""The catalogue entry of the EMCCD.

The methods import what they need, because its physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtl_model.imagers.emccd.section import EmccdSection
from rtl_model.imagers.interface.kind import ImagerKind

if TYPE_CHECKING:
    from cosim.run.printed import Row
    from rtl_model.imagers.device.bus import BusTarget
    from rtl_model.imagers.emccd.model import EmccdModel
    from rtl_model.imagers.interface.comparison import Comparison
    from rtl_model.imagers.interface.model import ImagerModel
    from rtl_model.imagers.report.imager_run import ImagerRun
    from rtl_model.registers.design import Design

__all__ = ["EmccdKind"]


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
        from rtl_model.imagers.emccd.model import EmccdModel

        return EmccdModel(section, seconds)

    def design(self) -> Design:
        from rtl_model.imagers.emccd.device.registers import DESIGN

        return DESIGN

    def bus_target(self) -> BusTarget:
        from rtl_model.imagers.emccd.device.bus_target import bus_target

        return bus_target()

    def comparison(self) -> Comparison:
        from rtl_model.imagers.emccd.comparison import EmccdComparison

        return EmccdComparison()

    def sections(self, model: EmccdModel, run: ImagerRun) -> str:
        from rtl_model.imagers.emccd.pages import emccd_sections

        return emccd_sections(model, run)

    def printed(self) -> list[Row]:
        from rtl_model.imagers.emccd.paper import emccd_rows

        return emccd_rows()
