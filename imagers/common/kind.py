"""What one kind of imager provides; the catalogue lists one object for each.

`ImagerSection` is the base of its [imager] section, `Comparison` its part in `viform compare`,
which films one scene with every camera.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt
from pydantic import Field

from cosim import InputError
from cosim.config.quantity import Section, Time
from cosim.frames import Frame

if TYPE_CHECKING:
    from cosim.run.printed import PrintedRow
    from imagers.common.model import ImagerModel
    from imagers.common.registers import BusTarget, ImagerBus
    from imagers.report.page import ImagerRun
    from rtl_model.geometry import Geometry
    from rtl_model.registers.design import Design
    from sensor.laboratory.cameras import Camera

Side = Annotated[int, Field(ge=1, le=4096)]
First = Annotated[int, Field(ge=0, le=4095)]
Device = Annotated[int, Field(ge=0, lt=2**32)]
Writes = Annotated[
    tuple[tuple[Time, str, Annotated[int, Field(ge=0, lt=2**32)]], ...],
    Field(
        max_length=1000,
        description='register writes over the serial line: ["5 ms", "register", value], the value '
        "in the register's own unit",
        examples=[[["5 ms", "exposure", 100]]],
    ),
]
"""(instant at which the write has arrived, register name, value) of each write."""
Values = npt.NDArray[np.float64]


class ImagerLens(Section):
    """The ideal lens in front of an imager."""

    f_number: Annotated[float, Field(ge=0.5, le=1000)]
    transmission: Annotated[float, Field(gt=0, le=1)] = 0.9
    magnification: Annotated[float, Field(ge=0, le=100)] = 0.0


class ImagerSection(Section):
    """The [imager] section of every kind of imager.

    Attributes:
        kind: name of the imager in the catalogue.
    """

    kind: str


@dataclass(frozen=True)
class Setting:
    """Pixels in one setting, and an exposure time.

    Attributes:
        pixels: the pixel model in that setting.
        seconds: exposure time, s.
    """

    pixels: Any
    seconds: float


class Comparison(ABC):
    """How an imager is set for the light of a scene, and how its frames are interpreted.

    Attributes:
        title: title of its row.
        note: what the picture does not show.
    """

    title: ClassVar[str]
    note: ClassVar[str] = ""

    def keys(self, shape: tuple[int, int]) -> dict[str, Any]:
        """Keys of its section for a scene of shape (rows, columns); keys of the user override."""
        return {"rows": shape[0], "columns": shape[1]}

    def adjust(self, section: Any, white: float, mean: float, given: frozenset[str]) -> Any:
        """The section, with the settings that the imager does not control itself chosen for the
        light.

        Args:
            section: settings of the user.
            white, mean: illuminance of white, and mean illuminance, on the plane, lux.
            given: keys that the user has set and that must not change.
        """
        return section

    @abstractmethod
    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        """The least and the most sensitive setting within the range of all controls."""

    def sent(self, section: Any) -> int:
        """Number of pixels of a frame that leave the imager."""
        return int(section.rows * section.columns)

    @abstractmethod
    def setting(self, section: Any, pixels: Any) -> str:
        """The setting in words; it is printed after frame rate and exposure."""

    def first_row(self, frame: Frame) -> int:
        """Row of the plane at which a frame begins."""
        return 0

    def pedestal(self, section: Any) -> float | None:
        """Value of black, DN, in frames from which dark frames are subtracted; None for frames
        without such a subtraction."""
        return None

    def without_smear(self, signal: Values, imager: Any, seconds: float) -> Values | None:
        """Removes the smear of frame transfer from a frame; None for an imager without smear.

        Args:
            signal: (H, W) values above black, DN.
            imager: imager that took the frame.
            seconds: exposure time, s.
        """
        return None


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
        from imagers.common.registers import ImagerBus

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

    def printed(self) -> list[PrintedRow]:
        """Each number that its document prints, with that of the simulation."""
        return []

    def _no_registers(self) -> InputError:
        return InputError("an imager", "one with registers", repr(self.name), "name another")
