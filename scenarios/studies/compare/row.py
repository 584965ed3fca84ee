"""The figures of one camera in a comparison."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

FIGURES = (
    "dynamic_range", "dynamic_range_controls", "blur", "noise", "data_rate", "data_rate_pixel",
    "latency", "psnr", "psnr_smear_corrected", "skew", "exposure", "saturated", "off",
)  # fmt: skip
"""Names of all figures of a row, in the order of the table."""


@dataclass(frozen=True)
class Figure:
    """A measured figure.

    Attributes:
        value: the value, None if it cannot be measured.
        unit: unit, "1" for a dimensionless figure.
    """

    value: float | None
    unit: str


@dataclass(frozen=True)
class Snr:
    """Signal over temporal noise where nothing moves.

    Attributes:
        reflectance: mean of the pixels.
        measured: ratio in a camera's images.
        formula: ratio by the closed form of the camera's pixels; None where there is none.
    """

    reflectance: float
    measured: float
    formula: float | None = None


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera of a comparison.

    Attributes:
        name: short name.
        title: name for headings.
        setting: description of the setting.
        note: remark for the table.
        image: estimate of reflectance at the instant, (H, W) in [0, 1].
        figures: figures by the names of `FIGURES`.
        seconds: run time of simulation and measurement, s.
        snr: signal over noise by reflectance, from dark to bright.
        corrected: image after correction of the frame-transfer smear; None without smear.
    """

    name: str
    title: str
    setting: str
    note: str
    image: npt.NDArray[np.float64]
    figures: dict[str, Figure]
    seconds: float = field(default=0.0)
    corrected: npt.NDArray[np.float64] | None = None
    snr: list[Snr] = field(default_factory=list)

    def row(self) -> dict[str, Any]:
        """The row of the document."""
        figures = {n: {"value": f.value, "unit": f.unit} for n, f in self.figures.items()}
        return {
            "imager": self.name, "title": self.title, "setting": self.setting, **figures,
            "note": self.note,
        }  # fmt: skip
