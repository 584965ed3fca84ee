"""Tiles of the pixel array: `lanes` pixels of one row, computed in one clock."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from rtl_model.geometry import Geometry

TILE = np.dtype(
    [("clock", "<u8"), ("frame", "<u4"), ("row", "<u2"), ("tile", "<u2"), ("bits", "<u8")]
)
"""A tile. `clock` is the edge at which it was computed, `frame` counts from the clear, and bit b of
`bits` is the spike of column tile * lanes + b."""

Tiles: TypeAlias = npt.NDArray[np.void]
"""Array of `TILE`, in order of clock."""


def rows_of(tiles: Tiles, geometry: Geometry) -> npt.NDArray[np.bool_]:
    """Spikes of complete rows, (rows, columns) bool.

    Args:
        tiles: tiles of complete rows, tile 0 first, as `System.run` returns them.
        geometry: geometry of the build.
    """
    bits = np.ascontiguousarray(tiles["bits"]).view(np.uint8).reshape(-1, 8)
    lanes = np.unpackbits(bits, axis=1, bitorder="little")[:, : geometry.lanes]
    return lanes.reshape(-1, geometry.tiles * geometry.lanes)[:, : geometry.columns].astype(bool)
