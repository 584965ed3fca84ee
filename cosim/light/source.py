"""The protocol of a scene: light block by block, and the truth behind it.

A source is the first stage of a run. It also answers for the truth that fidelity is measured
against: the reflectance at any instant, white = 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.light.light import Box, Light, Plane
from cosim.stage import Block

__all__ = ["Sketch", "Source", "Target"]


class Source(Protocol):
    """Light of a scene on the sensor's pixel grid, in lux of exitance, and the truth behind it.

    Attributes:
        shape: rows and columns.
        notes: how the scene was made, where a user must know it (temporal interpolation, cropping).
        degraded: caveats that make the result less than was asked for.
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

    def points(self) -> list[tuple[int, int, str]]:
        """Pixels that figures show: row, column, name."""
        ...


@dataclass(frozen=True, eq=False)
class Sketch:
    """A scene drawn at a few instants.

    Attributes:
        planes: of these instants, lux.
        reach: distance that an edge may move from an instant to the nearest of them, pixels.
        box: region that contains all change.
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
        name: for tables and figures.
        lux: illuminance on the scene.
        mask: its pixels, (H, W) bool.
    """

    name: str
    lux: float
    mask: npt.NDArray[np.bool_]
