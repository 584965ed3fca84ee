"""A scene without colours before a filter array."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cosim import Block, Light, Plane
from cosim.light.light import PlaneMap
from cosim.light.mosaic import Mosaic
from cosim.light.source import Sketch, Source


class NeutralSource:
    """A `Source` whose light is white: each pixel has the signal of its filter under white."""

    def __init__(self, source: Source, mosaic: Mosaic) -> None:
        self._source = source
        self._share = mosaic.neutral(source.shape)
        self._signal = self._share * np.float32(mosaic.white)
        self._map = PlaneMap(self._behind, 0)

    def _behind(self, plane: Plane) -> Plane:
        return plane * self._signal

    def __getattr__(self, name: str) -> Any:
        """Everything else is the scene's. A sketch, if it has one, has planes behind filters."""
        found = getattr(self._source, name)
        if name != "sketch":
            return found

        def sketch(*given: Any) -> Sketch:
            made: Sketch = found(*given)
            return replace(made, planes=[self._behind(plane) for plane in made.planes])

        return sketch

    def step(self, data: None, block: Block) -> Light:
        return self._map(self._source.step(data, block))

    def truth(self, ps: int) -> Plane:
        return self._source.truth(ps) * self._share
