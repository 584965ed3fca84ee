"""What is measured of one camera."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["FIGURES", "Camera", "Figure"]

FIGURES = (
    "dynamic_range", "dynamic_range_controls", "blur", "noise", "data_rate", "data_rate_pixel",
    "latency", "psnr", "psnr_smear_corrected", "skew", "exposure", "saturated", "off",
)  # fmt: skip
"""Every figure of a row, in the order of the table."""


@dataclass(frozen=True)
class Figure:
    """A measured figure.

    Attributes:
        value: None if it cannot be measured.
        unit: "1" for a plain number.
    """

    value: float | None
    unit: str


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera of a comparison.

    Attributes:
        name: short.
        title: as a heading.
        setting: in words.
        note: what the picture does not show.
        image: estimate of reflectance at the instant, (H, W) in [0, 1].
        figures: by the names of `FIGURES`.
        seconds: that filming and measuring took.
        corrected: the image without the smear of frame transfer; None for a camera that has none.
    """

    name: str
    title: str
    setting: str
    note: str
    image: npt.NDArray[np.float64]
    figures: dict[str, Figure]
    seconds: float = field(default=0.0)
    corrected: npt.NDArray[np.float64] | None = None

    def row(self) -> dict[str, Any]:
        """For the document."""
        figures = {n: {"value": f.value, "unit": f.unit} for n, f in self.figures.items()}
        return {
            "imager": self.name, "title": self.title, "setting": self.setting, **figures,
            "note": self.note,
        }  # fmt: skip
