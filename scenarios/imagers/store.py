"""Frames on disk as they come: `frames.zarr`, one chunk a frame.

values (n, H, W) uint16, padded below where a window made frames smaller; rows (n,) that are filled;
begin, end (n, H) int64 and ready (n,) int64 in picoseconds; attributes tell the bits and, once the
run is whole, `state`: the figures of the controllers, a list for each name.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import zarr

from cosim.frames import Frame

__all__ = ["FRAMES", "FrameStore", "read_frame"]

FRAMES = "frames.zarr"


class FrameStore:
    """Writes frames of at most (H, W) one after another. A store that is there is replaced."""

    def __init__(self, path: Path, bits: int) -> None:
        self._path, self._bits = path, bits
        self._group: Any = None
        self._state: list[dict[str, float]] = []
        self._pad: tuple[int, int] = (0, 0)

    def append(self, frame: Frame) -> None:
        if self._group is None:
            self._begin(frame)
        rows, width = frame.values.shape
        if rows > self._pad[0] or width > self._pad[1]:
            self._grow(max(rows, self._pad[0]), max(width, self._pad[1]))
        n = len(self._state)
        for name in ("values", "rows", "begin", "end", "ready"):
            array = self._group[name]
            array.resize((n + 1, *array.shape[1:]))
        self._group["values"][n, :rows, :width] = frame.values
        self._group["rows"][n] = rows
        self._group["begin"][n, :rows], self._group["end"][n, :rows] = frame.begin, frame.end
        self._group["ready"][n] = frame.ready
        self._state.append(dict(frame.state))

    def _begin(self, frame: Frame) -> None:
        rows, width = self._pad = frame.values.shape[0], frame.values.shape[1]
        self._group = zarr.open_group(self._path, mode="w")
        self._group.attrs.update({"bits": self._bits, "time": "ps"})

        def array(name: str, shape: tuple[int, ...], chunk: tuple[int, ...], kind: str) -> None:
            self._group.create_array(name, shape=(0, *shape), chunks=chunk, dtype=kind)

        array("values", (rows, width), (1, rows, width), "uint16")
        array("rows", (), (1024,), "int64")
        array("ready", (), (1024,), "int64")
        for name in ("begin", "end"):
            array(name, (rows,), (16, rows), "int64")

    def _grow(self, rows: int, width: int) -> None:
        self._pad = rows, width
        n = len(self._state)
        self._group["values"].resize((n, rows, width))
        for name in ("begin", "end"):
            self._group[name].resize((n, rows))

    def finish(self) -> None:
        """The controllers' figures."""
        if self._group is None:
            return
        names = sorted({name for state in self._state for name in state})
        self._group.attrs["state"] = {
            name: [state.get(name) for state in self._state] for name in names
        }


def read_frame(path: Path, n: int) -> npt.NDArray[np.uint16]:
    """Values of the n-th frame of a store, (rows, W)."""
    group: Any = zarr.open_group(path, mode="r")
    return np.asarray(group["values"][n, : int(group["rows"][n])])
