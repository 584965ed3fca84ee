"""What a scene is drawn on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from cosim import Clock
from cosim.light.source import Source

__all__ = ["SceneGrid", "SceneKind"]


@dataclass(frozen=True)
class SceneGrid:
    """The pixels and cycles of a run.

    Attributes:
        shape: (height, width) of the pixels.
        clock: of the cycles.
        cycles: of the run.
        aligned: whether every row is sampled at the clock's edge.
    """

    shape: tuple[int, int]
    clock: Clock
    cycles: int
    aligned: bool = True


class SceneKind(Protocol):
    """A [scene] section: its light, and how it becomes a source."""

    illuminance: float

    def source(self, grid: SceneGrid) -> Source:
        """The scene on a grid. A source may be run through once only. Raises InputError."""
        ...
