"""The catalogue entry of the EBAPS.

The methods import what they need, because its physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtl_model.imagers.ebaps.section import EbapsSection
from rtl_model.imagers.interface.kind import ImagerKind

if TYPE_CHECKING:
    from cosim.run.printed import Row
    from rtl_model.imagers.device.bus import BusTarget
    from rtl_model.imagers.ebaps.model import EbapsModel
    from rtl_model.imagers.interface.comparison import Comparison
    from rtl_model.imagers.interface.model import ImagerModel
    from rtl_model.imagers.report.imager_run import ImagerRun
    from rtl_model.registers.design import Design

__all__ = ["EbapsKind"]


class EbapsKind(ImagerKind):
    """See `ImagerKind`."""

    name = "ebaps"
    title = "EBAPS imaging circuit"
    section = EbapsSection
    number = 2
    document = (
        "002",
        "Yang, Qian, Liu, Lu, imaging circuit for an electron-bombarded CMOS sensor (EBAPS)",
    )

    def model(self, section: EbapsSection, seconds: float) -> ImagerModel:
        from rtl_model.imagers.ebaps.model import EbapsModel

        return EbapsModel(section)

    def design(self) -> Design:
        from rtl_model.imagers.ebaps.device.registers import DESIGN

        return DESIGN

    def bus_target(self) -> BusTarget:
        from rtl_model.imagers.ebaps.device.bus_target import bus_target

        return bus_target()

    def comparison(self) -> Comparison:
        from rtl_model.imagers.ebaps.comparison import EbapsComparison

        return EbapsComparison()

    def sections(self, model: EbapsModel, run: ImagerRun) -> str:
        from rtl_model.imagers.ebaps.pages import ebaps_sections

        return ebaps_sections(model, run)

    def printed(self) -> list[Row]:
        from rtl_model.imagers.ebaps.paper import ebaps_rows

        return ebaps_rows()
