"""The EMCCD as the catalogue lists it.

Modules are imported where they are needed: its physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rtl_model.imagers.emccd.section import EmccdSection
from rtl_model.imagers.kind import ImagerKind

if TYPE_CHECKING:
    from rtl_model.imagers.bus import BusTarget
    from rtl_model.imagers.comparison import Comparison
    from rtl_model.imagers.registers import Design
    from rtl_model.imagers.run.model import ImagerModel

__all__ = ["EmccdKind"]


class EmccdKind(ImagerKind):
    """See `ImagerKind`."""

    name = "emccd"
    title = "frame-transfer EMCCD"
    section = EmccdSection
    number = 3

    def model(self, section: EmccdSection, seconds: float) -> ImagerModel:
        from rtl_model.imagers.emccd.model import EmccdModel

        return EmccdModel(section, seconds)

    def design(self) -> Design:
        from rtl_model.imagers.emccd.registers import DESIGN

        return DESIGN

    def bus_target(self) -> BusTarget:
        from rtl_model.imagers.emccd.bus_target import bus_target

        return bus_target()

    def comparison(self) -> Comparison:
        from rtl_model.imagers.emccd.comparison import EmccdComparison

        return EmccdComparison()
