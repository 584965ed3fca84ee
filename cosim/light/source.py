"""The protocol of a scene: its light block by block, and its ground truth.

A source is the first stage of a run. It also provides the ground truth for fidelity: the
reflectance at any instant, white = 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.light.light import Box, Light, Plane
from cosim.stage import Block

Points = list[tuple[int, int, str]]
"""Row, column and name of pixels."""


class Source(Protocol):
    """Light of a scene on the pixel grid of the sensor, in lux of exitance, and its ground truth.

    Attributes:
        shape: rows and columns.
        notes: processing of the scene that a user must know (temporal interpolation, cropping).
        degraded: reasons for which the result falls short of the request.

    A source may also have `metrics`, figures of the scene for the result: name -> `Metric`.
    """

    shape: tuple[int, int]
    notes: list[str]
    degraded: list[str]

    def step(self, data: None, block: Block) -> Light:
        """The light of a block; blocks come in order."""
        ...

    def truth(self, ps: int) -> Plane:
        """Reflectance at an instant in picoseconds, (H, W) float32, white = 1."""
        ...

    def points(self) -> Points:
        """Pixels for figures: row, column, name."""
        ...


def truth_at(source: Source, ps: int, points: Points) -> list[float]:
    """The truth at some pixels. A source whose class has `truth_at` computes them alone."""
    if hasattr(type(source), "truth_at"):  # not that of a source within this one
        found: list[float] = source.truth_at(ps, points)  # type: ignore[attr-defined]
        return found
    plane = source.truth(ps)
    return [float(plane[row, column]) for row, column, _ in points]


@dataclass(frozen=True, eq=False)
class Sketch:
    """A scene rendered at a few instants.

    Attributes:
        planes: (H, W) each, lux at these instants.
        reach: largest displacement of an edge from any instant to the nearest of these, pixels.
        box: region that contains all changes.
        planes_per_cycle: new planes of light per cycle.
    """

    planes: list[Plane]
    reach: float
    box: Box
    planes_per_cycle: float


@dataclass(frozen=True, eq=False)
class Target:
    """A region of uniform, known light in a scene.

    Attributes:
        name: name in tables and figures.
        lux: illuminance on the scene.
        mask: its pixels, (H, W) bool.
    """

    name: str
    lux: float
    mask: npt.NDArray[np.bool_]
