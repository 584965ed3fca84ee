"""The grid on which a scene is drawn."""

from __future__ import annotations

from dataclasses import dataclass

from cosim import Clock
from cosim.light.mosaic import Mosaic


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
