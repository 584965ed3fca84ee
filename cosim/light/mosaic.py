"""A filter array on a plane of pixels: each pixel has one of three colours.

Light stays one plane: a scene in colour gives each pixel the signal of its own filter. The cells
repeat every two rows and columns (Bayer, US patent 3971065).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

FILTERS: Final = ("rggb", "bggr", "grbg", "gbrg")
"""Arrays by the colours of rows 0 and 1, columns 0 and 1."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mosaic:
    """A filter array and the response of its colours.

    Attributes:
        name: one of `FILTERS`.
        response: (3, 3), signal of a red, green and blue pixel (rows) for a scene of linear BT.709
            red, green and blue (columns), over that of a pixel without a filter under white.
    """

    name: str
    response: Values

    @property
    def white(self) -> float:
        """Signal of the brightest colour under white, over that of a pixel without a filter."""
        return float(self.response.sum(axis=1).max())

    @property
    def matrix(self) -> Values:
        """(3, 3) `response` with 1 for the brightest colour under white."""
        return self.response / self.white

    def colour(self, shape: tuple[int, ...]) -> npt.NDArray[np.intp]:
        """Colour of each pixel, (H, W): 0 red, 1 green, 2 blue."""
        cells = np.array(["rgb".index(letter) for letter in self.name]).reshape(2, 2)
        return np.tile(cells, (-(-shape[0] // 2), -(-shape[1] // 2)))[: shape[0], : shape[1]]

    def mixed(self, rgb: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        """Signal of each pixel, 1 for white in the brightest colour: (H, W) from (H, W, 3), linear
        red, green and blue."""
        weights = self.matrix.astype(np.float32)[self.colour(rgb.shape[:2])]
        return np.asarray(np.einsum("hwk,hwk->hw", weights, rgb), np.float32)

    def neutral(self, shape: tuple[int, ...]) -> npt.NDArray[np.float32]:
        """Signal of each pixel under white, (H, W)."""
        return self.matrix.sum(axis=1).astype(np.float32)[self.colour(shape)]
