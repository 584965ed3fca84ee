"""What one kind of imager provides; the catalogue lists one object for each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

from cosim import InputError
from imagers.common.section import ImagerSection

if TYPE_CHECKING:  # the schema and a host that reads registers must not load the physics
    from cosim.run.printed import Row
    from imagers.common.bus import BusTarget, ImagerBus
    from imagers.common.comparison import Comparison
    from imagers.common.model import ImagerModel
    from imagers.report.imager_run import ImagerRun
    from rtl_model.geometry import Geometry
    from rtl_model.registers.design import Design
    from sensor.laboratory.cameras import Camera

__all__ = ["ImagerKind"]


class ImagerKind(ABC):
    """One kind of imager. Each method imports the modules that it needs, because the physics takes
    seconds to load.

    Attributes:
        name: `imager.kind` in a scenario.
        title: a few words for headings.
        section: class of its [imager] section.
        number: value of its register `ctrl_imager`; None for an imager without registers.
        document: number and title of its source document; None if `viform paper` has none.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    section: ClassVar[type[ImagerSection]]
    number: ClassVar[int | None] = None
    document: ClassVar[tuple[str, str] | None] = None

    @abstractmethod
    def model(self, section: Any, seconds: float) -> ImagerModel:
        """The imager with the settings of a scenario.

        Args:
            section: an instance of `section`.
            seconds: duration of the run.
        """

    def design(self) -> Design:
        """Its registers at default settings. Raises InputError for an imager without registers."""
        raise self._no_registers()

    def bus_target(self) -> BusTarget:
        """Its sequencer after power-on, with registers, under constant light, without pixels.
        Raises InputError for an imager without registers."""
        raise self._no_registers()

    def bus(self, geometry: Geometry) -> ImagerBus:
        """That sequencer behind the bus of a line with this clock and baud. Raises InputError for
        an imager without registers."""
        from imagers.common.bus import ImagerBus

        return ImagerBus(self.bus_target(), geometry)

    def comparison(self) -> Comparison | None:
        """Its part of `viform compare`; None for an imager that is not compared."""
        return None

    def measured(self) -> Camera | None:
        """Its part of `viform laboratory`; None for an imager that is not measured."""
        return None

    def sections(self, model: Any, run: ImagerRun) -> str:
        """Writes the figures of its sections of the report and returns their HTML.

        Args:
            model: the imager with the settings of the scenario.
            run: the finished run.
        """
        return ""

    def printed(self) -> list[Row]:
        """Each number that its document prints, with that of the simulation."""
        return []

    def _no_registers(self) -> InputError:
        return InputError("an imager", "one with registers", repr(self.name), "name another")
