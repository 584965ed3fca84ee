"""The plane in tiles of 16 x 16 pixels: the unit of plans and of errors.

A work-item of a kernel also has sixteen columns, so a tile consists of whole work-items.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

TILE: Final = 16
"""Rows and columns of a tile."""


@dataclass(frozen=True)
class TileGrid:
    """Tiles of a plane of (height, width) pixels in row-major order. Tiles at the right and bottom
    edges may be smaller."""

    height: int
    width: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of tiles."""
        return -(-self.height // TILE), -(-self.width // TILE)

    def __len__(self) -> int:
        return self.shape[0] * self.shape[1]

    def box(self, tile: int) -> tuple[int, int, int, int]:
        """Rows y0 to y1 and columns x0 to x1 of a tile, without the ends."""
        row, column = divmod(tile, self.shape[1])
        y, x = row * TILE, column * TILE
        return y, min(y + TILE, self.height), x, min(x + TILE, self.width)

    @property
    def whole(self) -> npt.NDArray[np.bool_]:
        """Whether a tile has the full size, (tiles,)."""
        rows, columns = self.shape
        tall = np.minimum(np.arange(rows) * TILE + TILE, self.height) - np.arange(rows) * TILE
        wide = np.minimum(np.arange(columns) * TILE + TILE, self.width) - np.arange(columns) * TILE
        return np.outer(tall == tall.max(), wide == wide.max()).ravel()

    def reduce(self, plane: npt.NDArray[Any], how: np.ufunc) -> npt.NDArray[Any]:
        """`how` (np.minimum, np.maximum, np.logical_and, ...) over the pixels of each tile,
        (tiles,)."""
        # `reduceat` would take pixel by pixel where `reduce` takes whole rows.
        rows = _reduced(plane, how)
        return np.ascontiguousarray(_reduced(rows.T, how).T).ravel()

    def groups(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Values of tiles, (tiles,), as values of work-items, (height, columns of tiles)."""
        return np.repeat(values.reshape(self.shape), TILE, axis=0)[: self.height]


def _reduced(plane: npt.NDArray[Any], how: np.ufunc) -> npt.NDArray[Any]:
    """`how` over each TILE rows of a plane, (rows of tiles, columns)."""
    height, width = plane.shape
    whole = height // TILE
    parts = [how.reduce(plane[: whole * TILE].reshape(whole, TILE, width), axis=1)]
    if height > whole * TILE:
        parts.append(how.reduce(plane[whole * TILE :], axis=0, keepdims=True))
    return np.concatenate(parts)
