"""Frames on disk: `frames.zarr`, one chunk a frame.

values (n, H, W) uint16, padded below where a window made frames smaller; rows (n,) that are filled;
begin, end (n, H) int64 and ready (n,) int64 in picoseconds; attributes tell the bits and, once the
run is finished, `state`: the figures of the controllers, a list for each name.
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
_TOGETHER = 1 << 26
"""Bytes of frames that are written at once."""


class FrameStore:
    """Writes frames in order, a few at a time: of a run that is interrupted, the rest is on its
    tape. An existing store is replaced."""

    def __init__(self, path: Path, bits: int) -> None:
        self._path, self._bits = path, bits
        self._group: Any = None
        self._waiting: list[npt.NDArray[np.uint16]] = []
        self._times: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], int]] = []
        self._state: list[dict[str, float]] = []
        self._pad: tuple[int, int] = (0, 0)

    def append(self, frame: Frame) -> None:
        rows, width = frame.values.shape
        self._pad = max(rows, self._pad[0]), max(width, self._pad[1])
        self._waiting.append(frame.values)
        self._times.append((frame.begin, frame.end, frame.ready))
        self._state.append(dict(frame.state))
        if sum(values.nbytes for values in self._waiting) > _TOGETHER:
            self._write()

    def _write(self) -> None:
        count, (rows, width) = len(self._state), self._pad
        if self._group is None:
            self._group = zarr.open_group(self._path, mode="w")
            self._group.create_array(
                "values", shape=(0, rows, width), chunks=(1, rows, width), dtype="uint16"
            )
        values = self._group["values"]
        values.resize((count, rows, width))
        block = np.zeros((len(self._waiting), rows, width), np.uint16)
        for into, given in zip(block, self._waiting, strict=True):
            into[: given.shape[0], : given.shape[1]] = given
        values[count - len(block) :] = block
        self._waiting = []

    def finish(self) -> None:
        """Writes the remaining frames, the times and the controllers' figures."""
        if not self._state:
            return
        if self._waiting or self._group is None:
            self._write()
        count, high = len(self._times), self._pad[0]
        rows = np.array([len(begin) for begin, *_ in self._times], np.int64)
        begin, end = np.zeros((2, count, high), np.int64)
        for n, (one, two, _) in enumerate(self._times):
            begin[n, : len(one)], end[n, : len(two)] = one, two
        ready = np.array([each for *_, each in self._times], np.int64)
        named = (("rows", rows), ("begin", begin), ("end", end), ("ready", ready))
        for name, data in named:
            self._group.create_array(name, data=data)
        names = sorted({name for state in self._state for name in state})
        figures = {name: [state.get(name) for state in self._state] for name in names}
        self._group.attrs.update({"bits": self._bits, "time": "ps", "state": figures})


def read_frame(path: Path, n: int) -> npt.NDArray[np.uint16]:
    """Values of the n-th frame of a store, (rows, W)."""
    group: Any = zarr.open_group(path, mode="r")
    return np.asarray(group["values"][n, : int(group["rows"][n])])
