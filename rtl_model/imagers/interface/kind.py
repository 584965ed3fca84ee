"""What the folder of an imager provides, in one object that the catalogue lists."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

from cosim import InputError
from rtl_model.imagers.interface.section import ImagerSection

if TYPE_CHECKING:  # the schema, and a host that reads registers, need none of the physics
    from cosim.run.printed import Row
    from rtl_model.imagers.device.bus import BusTarget
    from rtl_model.imagers.device.registers import Design
    from rtl_model.imagers.interface.comparison import Comparison
    from rtl_model.imagers.interface.model import ImagerModel
    from rtl_model.imagers.report.imager_run import ImagerRun

__all__ = ["ImagerKind"]


class ImagerKind(ABC):
    """One kind of imager. What a method needs it imports itself: physics takes seconds to load.

    Attributes:
        name: as `imager.kind` has it.
        title: a few words for headings.
        section: class of its [imager] section.
        number: what its register `ctrl_imager` reads; None for an imager without registers.
        document: number and title of its source document; None if `viform paper` has none.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    section: ClassVar[type[ImagerSection]]
    number: ClassVar[int | None] = None
    document: ClassVar[tuple[str, str] | None] = None

    @abstractmethod
    def model(self, section: Any, seconds: float) -> ImagerModel:
        """The imager as a scenario sets it.

        Args:
            section: an instance of `section`.
            seconds: duration of the run.
        """

    def design(self) -> Design:
        """Its registers as they are by default. Raises InputError for an imager without any."""
        raise self._no_registers()

    def bus_target(self) -> BusTarget:
        """Its sequencer after power-on, with registers and steady light, but no pixels. Raises
        InputError for an imager without registers."""
        raise self._no_registers()

    def comparison(self) -> Comparison | None:
        """Its side of `viform compare`; None for an imager that is not compared."""
        return None

    def sections(self, model: Any, run: ImagerRun) -> str:
        """HTML of its own sections of the report; their figures are written.

        Args:
            model: the imager as the scenario sets it.
            run: what was filmed.
        """
        return ""

    def printed(self) -> list[Row]:
        """Every number that its document prints, beside that of the simulation."""
        return []

    def _no_registers(self) -> InputError:
        return InputError("an imager", "one with registers", repr(self.name), "name another")
