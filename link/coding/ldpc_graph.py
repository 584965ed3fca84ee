"""The base graphs of the low-density parity-check codes of 3GPP TS 38.212 (5G NR), version 18.

A base graph has a row for each group of Z checks and a column for each group of Z bits, Z the
lifting size. An edge of the graph with the value V is the Z x Z identity matrix, whose columns are
rotated to the right by V mod Z: check z has the bit (z + V) mod Z of the column. V depends on the
set of the lifting size.

The tables are `ldpc_graph_1.csv` (table 5.3.2-2) and `ldpc_graph_2.csv` (table 5.3.2-3), an edge a
line: row, column, V of the sets 0 to 7. They were read from the data of sionna 2.2.0 and compared
with those of neoradium 0.5.3; the one edge of the 513 that differed, row 6, column 0 of graph 1
(158 and 80 in the sets 3 and 4), was settled by a third copy.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Final

import numpy as np
import numpy.typing as npt

_FACTORS: Final = (2, 3, 5, 7, 9, 11, 13, 15)
_LARGEST: Final = 384
LIFTINGS: Final = {
    factor << power: number
    for number, factor in enumerate(_FACTORS)
    for power in range(8)
    if factor << power <= _LARGEST
}
"""Lifting size -> number of its set (table 5.3.2-1)."""
_DATA_COLUMNS: Final = {1: 22, 2: 10}
_Integers = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Graph:
    """A base graph.

    The columns are data, then parity. Row r has a parity column with the value 0 that no later row
    has: data_columns + 1 + r for r < 3, data_columns + r for r > 3. Rows 0 to 3 have the column
    data_columns three times, twice with the same value.

    Attributes:
        data_columns: number of columns of data.
        rows: number of rows.
        row, column: row and column of each edge, (edges,) int32, sorted by row.
        values: V of each edge and set, (edges, 8) int32.
    """

    data_columns: int
    rows: int
    row: _Integers
    column: _Integers
    values: _Integers


@lru_cache
def base_graph(number: int) -> Graph:
    """Base graph 1 (46 x 68) or 2 (42 x 52).

    Raises:
        ValueError: if there is no such graph.
    """
    if number not in _DATA_COLUMNS:
        raise ValueError(f"graph must be 1 or 2, not {number}")
    text = (files("link.coding") / f"ldpc_graph_{number}.csv").read_text(encoding="utf-8")
    table = np.loadtxt(text.splitlines(), np.int32, delimiter=",", skiprows=1)
    row, column = table[:, 0].copy(), table[:, 1].copy()
    return Graph(_DATA_COLUMNS[number], int(row[-1]) + 1, row, column, table[:, 2:].copy())
