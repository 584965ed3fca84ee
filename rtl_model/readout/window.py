"""The window of the readout: rows that are read, and columns that may fire."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.files.raw_layout import HALF, RAW_SIZE, TABLE, Table, markers


class Window(NamedTuple):
    """A window, in the format of the board's registers.

    Rows outside the window are not read: the output lacks their blocks, and the scan is shorter.
    Columns outside the window read 0, because a row is always read completely.

    Attributes:
        rows, columns: (first, last), both inclusive.
    """

    rows: tuple[int, int] = (0, RAW_SIZE[1] - 1)
    columns: tuple[int, int] = (0, RAW_SIZE[0] - 1)

    def checked(self) -> Window:
        """The window itself. Raises InputError if it is empty or exceeds the chip."""
        for name, (first, last), size in (
            ("rows", self.rows, RAW_SIZE[1]),
            ("columns", self.columns, RAW_SIZE[0]),
        ):
            if not 0 <= first <= last < size:
                raise InputError(
                    f"the window's {name}", f"first to last within 0 to {size - 1}",
                    f"{first} to {last}", "give others",
                )  # fmt: skip
        return self

    @property
    def read(self) -> npt.NDArray[np.intp]:
        """Blocks of a full frame that are read, in the order of the output, (blocks,) intp."""
        return np.flatnonzero((TABLE.row >= self.rows[0]) & (TABLE.row <= self.rows[1]))

    @property
    def places(self) -> npt.NDArray[np.uint32]:
        """Half row of the chip, 2 row + half, of each block, (blocks,) uint32."""
        return (TABLE.row * 2 + TABLE.half)[self.read].astype(np.uint32)

    @property
    def markers(self) -> npt.NDArray[np.uint16]:
        """Marker in the last 16 bits of each block, (blocks,) uint16."""
        return markers(Table(*(column[self.read] for column in TABLE)))

    @property
    def open(self) -> npt.NDArray[np.bool_]:
        """Columns that may fire, by half row, (2, pixels of a block) bool."""
        column = np.arange(RAW_SIZE[0])
        inside = (column >= self.columns[0]) & (column <= self.columns[1])
        return inside.reshape(2, HALF)
