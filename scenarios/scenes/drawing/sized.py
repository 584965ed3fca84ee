"""Drawn scenes on arrays that are smaller or larger than they can be drawn.

A scene is drawn 8 to 2000 pixels a side. For any other array it is drawn at the nearest size, and
each pixel of the array shows the drawn pixel at the same place of the picture. Larger arrays see
larger pixels of the drawing, not more detail.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block, Box, Light, Plane
from cosim.light.light import PlaneMap
from cosim.light.source import Sketch, Source
from cosim.light.survey import limits
from scenarios.scenes.drawing.canvas import LARGEST, SMALLEST


def sized(shape: tuple[int, int], draw: Callable[[tuple[int, int]], Source]) -> Source:
    """The source of an array of this shape. draw: the source at a size at which it can be drawn."""
    height, width = (min(max(side, SMALLEST), LARGEST) for side in shape)
    source = draw((height, width))
    return source if (height, width) == shape else SizedSource(source, shape)


def _places(side: int, drawn: int) -> npt.NDArray[np.int64]:
    """The drawn row (or column) at the middle of each row of the array, (side,)."""
    return (2 * np.arange(side, dtype=np.int64) + 1) * drawn // (2 * side)


class SizedSource:
    """A drawn scene as the `Source` of an array of another size.

    Attributes:
        shape: rows and columns of the array.
        notes: notes of the drawing, with the size at which it is drawn.
        pursuit: speed along the rows that an eye follows, pixels/s of the array; None without one.
    """

    def __init__(self, source: Source, shape: tuple[int, int]) -> None:
        self._source, self.shape = source, shape
        self._rows, self._columns = (
            _places(side, drawn) for side, drawn in zip(shape, source.shape, strict=True)
        )
        self._map = PlaneMap(self._placed, None)
        self._scale = shape[1] / source.shape[1]
        pursuit: float | None = getattr(source, "pursuit", None)
        self.pursuit = None if pursuit is None else pursuit * self._scale
        height, width = source.shape
        self.notes = [*source.notes, f"drawn at {width} x {height} and shown on the chip's pixels"]

    def __getattr__(self, name: str) -> Any:
        """Everything else is the drawing's. A sketch, if it has one, is placed on the array."""
        found = getattr(self._source, name)
        if name != "sketch":
            return found

        def sketch(*given: Any) -> Sketch:
            made: Sketch = found(*given)
            # An edge may come from a drawn pixel that no pixel of the array shows.
            planes = [self._placed(plane) for plane in limits(made)]
            return replace(made, planes=planes, reach=0.0, box=self._box(made.box))

        return sketch

    def _placed(self, plane: Plane) -> Plane:
        return plane[self._rows[:, None], self._columns]

    def _box(self, box: Box) -> Box:
        """The box on the array that shows a box of the drawing."""
        (y0, y1), (x0, x1) = (
            np.searchsorted(places, ends).tolist()
            for places, ends in ((self._rows, box[:2]), (self._columns, box[2:]))
        )
        return y0, y1, x0, x1

    def step(self, data: None, block: Block) -> Light:
        return self._map(self._source.step(data, block))

    def truth(self, ps: int) -> Plane:
        return self._placed(self._source.truth(ps))

    def points(self) -> list[tuple[int, int, str]]:
        height, width = self.shape
        return [
            (
                min(int(np.searchsorted(self._rows, row)), height - 1),
                min(int(np.searchsorted(self._columns, column)), width - 1),
                name,
            )
            for row, column, name in self._source.points()
        ]
