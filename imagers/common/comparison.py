"""The part of an imager in `viform compare`, which films one scene with every camera."""

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
            imager: that took the frame.
            seconds: exposure time, s.
        """
        return None
