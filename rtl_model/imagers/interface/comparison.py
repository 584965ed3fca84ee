"""The side of an imager in `viform compare`, which films one scene with every camera."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame

__all__ = ["Comparison", "Setting"]

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Setting:
    """Pixels in one setting and an exposure time, s."""

    pixels: Any
    seconds: float


class Comparison(ABC):
    """How an imager is set for the light of a scene, and how its frames are read.

    Attributes:
        title: of its row.
        note: what the picture does not show.
    """

    title: ClassVar[str]
    note: ClassVar[str] = ""

    def keys(self, shape: tuple[int, int]) -> dict[str, Any]:
        """Keys of its section for a scene of so many rows and columns; the user's go before."""
        return {"rows": shape[0], "columns": shape[1]}

    def adjust(self, section: Any, white: float, mean: float, given: frozenset[str]) -> Any:
        """The section with what the imager does not set by itself, set for the light.

        Args:
            section: as the user has set it.
            white, mean: illuminance of white and the mean one on the plane, lux.
            given: keys that the user has set, which stay.
        """
        return section

    @abstractmethod
    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        """The least and the most sensitive setting that all controls of the imager reach."""

    @abstractmethod
    def sent(self, section: Any) -> int:
        """Pixels of a frame that leave the imager."""

    @abstractmethod
    def setting(self, section: Any, pixels: Any) -> str:
        """The setting in words, after frame rate and exposure."""

    def first_row(self, frame: Frame) -> int:
        """Row of the plane at which a frame begins."""
        return 0

    def pedestal(self, section: Any) -> float | None:
        """DN of black in frames from which dark frames are subtracted; None if they are not."""
        return None

    def without_smear(self, signal: Values, imager: Any, seconds: float) -> Values | None:
        """A frame's signal above black (DN), exposed for so long, without the smear of frame
        transfer; None for an imager that has none."""
        return None
