"""The plane in tiles of 16 x 16 pixels, the unit of plans and of errors, and patches of a plane.

A work-item of a kernel also has sixteen columns, so a tile consists of whole work-items. A plan is
checked on patches: boxes of one size, such as tiles, stacked into one tall plane. Pixels keep their
numbers, the sampling instants of their rows and the light of their neighbours, so each pixel has
the same bits as on the whole plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim.light.light import Plane

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


@dataclass(frozen=True, eq=False)
class BoxGrid:
    """Boxes at any place of a plane.

    Attributes:
        height, width: size of the plane.
        boxes: rows y0 to y1 and columns x0 to x1 of each, without the ends, (boxes, 4).
    """

    height: int
    width: int
    boxes: npt.NDArray[np.int64]

    def box(self, tile: int) -> tuple[int, int, int, int]:
        y0, y1, x0, x1 = self.boxes[tile].tolist()
        return y0, y1, x0, x1


class Boxes(Protocol):
    """A plane of (height, width) pixels in numbered boxes, such as `TileGrid`. A box has rows y0 to
    y1 and columns x0 to x1, without the ends."""

    @property
    def height(self) -> int: ...
    @property
    def width(self) -> int: ...
    def box(self, tile: int) -> tuple[int, int, int, int]: ...


class PatchPlane:
    """Patches of one size, stacked: (patches x rows, columns).

    Args:
        grid: the plane in boxes.
        tiles: numbers of the boxes that become patches.

    Attributes:
        grid, tiles: the arguments.
        rows, columns: size of a patch.
        shape: (patches x rows, columns).
        row: (patches x rows,) row on the plane of each row here.
        numbers: (pixels,) uint32, numbers of the pixels on the plane.

    Raises:
        ValueError: the boxes differ in size.
    """

    def __init__(self, grid: Boxes, tiles: list[int]) -> None:
        boxes = [grid.box(tile) for tile in tiles]
        sizes = {(y1 - y0, x1 - x0) for y0, y1, x0, x1 in boxes}
        if len(sizes) != 1:
            raise ValueError(f"patches must be of one size, not {sorted(sizes)}")
        self.grid, self.tiles = grid, tiles
        ((self.rows, self.columns),) = sizes
        self.shape = (len(tiles) * self.rows, self.columns)
        y = np.stack([np.arange(b[0] - 1, b[1] + 1) for b in boxes])
        x = np.stack([np.arange(b[2] - 1, b[3] + 1) for b in boxes])
        self._y = np.clip(y, 0, grid.height - 1)
        self._x = np.clip(x, 0, grid.width - 1)
        self.row = self._y[:, 1:-1].ravel()
        rows, columns = self._y[:, 1:-1, None], self._x[:, None, 1:-1]
        self.numbers = (rows * grid.width + columns).astype(np.uint32).ravel()

    @property
    def places(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Rows (patches, rows + 2) and columns (patches, columns + 2) of the plane that `cut`
        reads."""
        return self._y, self._x

    def cut(self, plane: Plane) -> Plane:
        """The patches of a plane with a border of one pixel, stacked. Outside the plane, its edge
        pixels are repeated."""
        cut = plane[self._y[:, :, None], self._x[:, None, :]]
        return np.ascontiguousarray(cut.reshape(-1, self.columns + 2))

    def inner(self, plane: Plane) -> Plane:
        """The patches without the border that `cut` adds."""
        cut = plane.reshape(len(self.tiles), self.rows + 2, self.columns + 2)[:, 1:-1, 1:-1]
        return np.ascontiguousarray(cut.reshape(self.shape))

    def split(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Reshapes (..., pixels) values to (..., patches, pixels of a patch)."""
        return values.reshape(*values.shape[:-1], len(self.tiles), -1)
