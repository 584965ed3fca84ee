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
    """value: None where it cannot be measured. unit: "1" for a plain number."""

    value: float | None
    unit: str


@dataclass(frozen=True, eq=False)
class Camera:
    """name: short. title: as a heading. setting: in words. image: estimate of reflectance at the
    instant, (H, W) in [0, 1]. figures: by the names of `FIGURES`. corrected: the image with the
    smear of frame transfer taken off, of a camera that has it."""

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
        told = {n: {"value": f.value, "unit": f.unit} for n, f in self.figures.items()}
        return {
            "imager": self.name, "title": self.title, "setting": self.setting, **told,
            "note": self.note,
        }  # fmt: skip
