"""The grid on which a scene is drawn, and the protocol of the kinds of scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from cosim import Clock
from cosim.light.mosaic import Mosaic
from cosim.light.source import Source


@dataclass(frozen=True)
class SceneGrid:
    """The pixels and cycles of a run.

    Attributes:
        shape: (height, width), pixels.
        clock: clock of the cycles.
        cycles: length of the run, cycles.
        aligned: whether every row is sampled at the clock edge.
        mosaic: filter array on the pixels; None for none.
    """

    shape: tuple[int, int]
    clock: Clock
    cycles: int
    aligned: bool = True
    mosaic: Mosaic | None = None


class SceneKind(Protocol):
    """A section [scene].

    Attributes:
        illuminance: illuminance of the scene, lux.
    """

    illuminance: float

    def source(self, grid: SceneGrid) -> Source:
        """The scene on a grid. A source can be used for one pass only. Raises InputError for values
        that do not fit together."""
        ...
