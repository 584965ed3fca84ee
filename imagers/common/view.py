"""The light on the plane of an imager during a run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cosim.run.result import Metric
from imagers.common.scenery import Scenery

__all__ = ["View"]

Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class View:
    """A scene as the plane of an imager receives it.

    Attributes:
        scenery: the light.
        gain: illuminance on the plane for an exitance of 1 lux, lux.
        least, most: (H, W) limits of the illuminance on the plane during the run, lux, float64.
        certain: whether these limits are proven.
        chart: (H, W) reflectance of a static scene, float64; None for a moving one.
        notes: notes about the scene for the user.
        degraded: reasons for which the run does not show the scene as asked.
        chart_name: name of a computed chart; "" for any other scene.
        metrics: figures of the scene for the result.
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
    metrics: dict[str, Metric] = field(default_factory=dict)
