"""The catalogue entry of the hardware chain.

The methods import what they need, because the physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from imagers.common.kind import ImagerKind
from imagers.hardware_chain.section import HardwareChainSection

if TYPE_CHECKING:
    from cosim.run.printed import PrintedRow
    from imagers.common.kind import Comparison
    from imagers.common.model import ImagerModel
    from imagers.hardware_chain.model import HardwareChainModel
    from imagers.report.page import ImagerRun
if TYPE_CHECKING:
    pass


class HardwareChainKind(ImagerKind):
    """See `ImagerKind`."""

    name = "hardware-chain"
    title = "timed exposure through a hardware chain"
    section = HardwareChainSection
    document = (
        "004", "Wang et al., patent on the dynamic range of a system from a hardware model (2017)",
    )  # fmt: skip

    def model(self, section: HardwareChainSection, seconds: float) -> ImagerModel:
        from imagers.hardware_chain.model import HardwareChainModel

        return HardwareChainModel(section)

    def comparison(self) -> Comparison:
        from imagers.hardware_chain.model import HardwareChainComparison

        return HardwareChainComparison()

    def sections(self, model: HardwareChainModel, run: ImagerRun) -> str:
        from imagers.hardware_chain.pages import chain_sections

        return chain_sections(model, run)

    def printed(self) -> list[PrintedRow]:
        from imagers.hardware_chain.paper import dynamic_range_rows

        return dynamic_range_rows()
