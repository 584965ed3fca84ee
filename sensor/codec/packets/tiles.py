"""A sensor cut into square tiles, in raster order; those at the border may be smaller."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tiles:
    """The tiles of a sensor.

    Attributes:
        shape: (height, width) of the sensor in pixels.
        side: side of a tile, pixels.
    """

    shape: tuple[int, int]
    side: int

    def __post_init__(self) -> None:
        if min(self.shape) < 1:
            raise ValueError(f"a sensor must have pixels, not {self.shape}")
        if not 8 <= self.side <= 128 or self.side % 8:
            raise ValueError(f"tile must be a multiple of 8 from 8 to 128, not {self.side}")

    @property
    def grid(self) -> tuple[int, int]:
        """(rows, columns) of tiles."""
        return -(-self.shape[0] // self.side), -(-self.shape[1] // self.side)

    def __len__(self) -> int:
        rows, columns = self.grid
        return rows * columns

    def place(self, tile: int) -> tuple[slice, slice]:
        """Rows and columns of the pixels of a tile."""
        y, x = divmod(tile, self.grid[1])
        side, (height, width) = self.side, self.shape
        return (
            slice(y * side, min((y + 1) * side, height)),
            slice(x * side, min((x + 1) * side, width)),
        )

    def size(self, tile: int) -> tuple[int, int]:
        """(height, width) of a tile in pixels."""
        rows, columns = self.place(tile)
        return rows.stop - rows.start, columns.stop - columns.start
