"""The catalogue entry of the EBAPS.

The methods import what they need, because the physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from imagers.common.kind import ImagerKind
from imagers.ebaps.section import EbapsSection

if TYPE_CHECKING:
    from cosim.run.printed import PrintedRow
    from imagers.common.kind import Comparison
    from imagers.common.model import ImagerModel
    from imagers.common.registers import BusTarget
    from imagers.ebaps.model import EbapsModel
    from imagers.report.page import ImagerRun
    from rtl_model.registers.design import Design
    from sensor.laboratory.cameras import Camera


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
        from imagers.ebaps.model import EbapsModel

        return EbapsModel(section)

    def design(self) -> Design:
        from imagers.ebaps.device.sequencer import DESIGN

        return DESIGN

    def bus_target(self) -> BusTarget:
        from imagers.ebaps.device.sequencer import bus_target

        return bus_target()

    def comparison(self) -> Comparison:
        from imagers.ebaps.model import EbapsComparison

        return EbapsComparison()

    def measured(self) -> Camera:
        from imagers.ebaps.model import MEASURED

        return MEASURED

    def sections(self, model: EbapsModel, run: ImagerRun) -> str:
        from imagers.ebaps.pages import ebaps_sections

        return ebaps_sections(model, run)

    def printed(self) -> list[PrintedRow]:
        from imagers.ebaps.paper import ebaps_rows

        return ebaps_rows()
