"""The light on an imager's plane during a run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from sensor.imagers import Scenery

__all__ = ["View"]

Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class View:
    """A scene as an imager's plane receives it.

    Attributes:
        scenery: the light.
        gain: lux on the plane for one lux of exitance.
        least, most: (H, W) limits of the illuminance on the plane during the run, lux.
        certain: whether these limits are proven.
        chart: (H, W) reflectance of a scene that stands still; None for one that moves.
        notes: what the user must know of the scene.
        degraded: reasons for which the run does not show the scene as asked.
        chart_name: name of a drawn chart, "" for any other scene.
    """

    scenery: Scenery
    gain: float
    least: Values
    most: Values
    certain: bool
    chart: Values | None
    notes: list[str] = field(default_factory=list)
    degraded: list[str] = field(default_factory=list)
    chart_name: str = ""
