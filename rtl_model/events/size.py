"""Size of one event path: the parameters of its Verilog."""

from __future__ import annotations

from typing import NamedTuple


class EventSize(NamedTuple):
    """Parameters of `viform_event_encoder` and `viform_event_decoder`.

    Attributes:
        rows, columns: rows and columns of pixels, 1 to 128.
        lanes: pixels of a tile that comes in one clock, 32 or 64.
        cycles: cycles of a packet, 32, 64 or 128.
        depth: entries of the queue, a power of two.
        tile: number of the array in the packets.
    """

    rows: int = 32
    columns: int = 32
    lanes: int = 32
    cycles: int = 128
    depth: int = 256
    tile: int = 0

    @property
    def tiles(self) -> int:
        """Tiles of `lanes` pixels in a row."""
        return -(-self.columns // self.lanes)

    @property
    def row_clocks(self) -> int:
        """Clocks from a row's first tile to that of the next, as in `viform_board`."""
        return self.tiles * self.lanes // 32 + 4

    @property
    def tick_minimum(self) -> int:
        """Shortest frame of such an array, clocks."""
        return self.rows * self.row_clocks + 4

    @property
    def pixels(self) -> int:
        """Pixels of the array."""
        return self.rows * self.columns

    @property
    def verilog(self) -> dict[str, int]:
        """Parameters of the Verilog by name."""
        return {
            "ROWS": self.rows,
            "COLUMNS": self.columns,
            "LANES": self.lanes,
            "CYCLES": self.cycles,
            "DEPTH": self.depth,
            "TILE": self.tile,
        }
