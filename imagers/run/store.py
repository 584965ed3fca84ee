"""The frames of a run on disk: the Zarr group `frames.zarr`, with one chunk per frame.

Arrays: `values` (n, H, W) uint16, DN, padded with zeros below and to the right of smaller frames;
`rows` (n,) int64, filled rows; `begin`, `end` (n, H) int64, exposure of each row, ps; `ready` (n,)
int64, end of readout, ps. Attributes: `bits`; `time`, the unit; `state`, the figures of the
controllers as one list for each name; and `registers`, likewise, what a host reads in each register
once a frame is ready. All but `values` are written at the end of the run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import zarr

from cosim.frames import Frame

__all__ = ["FRAMES", "FrameStore", "read_frame"]

FRAMES = "frames.zarr"
_TOGETHER = 1 << 26
"""Bytes of frames that are collected before they are written."""


class FrameStore:
    """Writes frames in order, several at once. An existing store is replaced. The frames of an
    interrupted run are recovered from its tape."""

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
        for target, frame in zip(block, self._waiting, strict=True):
            target[: frame.shape[0], : frame.shape[1]] = frame
        values[count - len(block) :] = block
        self._waiting = []

    def finish(self, registers: Mapping[str, Sequence[int]]) -> None:
        """Writes the remaining frames, the times, the figures of the controllers, and what the
        registers hold, one value for each frame."""
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
        held = {name: [int(value) for value in values] for name, values in registers.items()}
        self._group.attrs.update(
            {"bits": self._bits, "time": "ps", "state": figures, "registers": held}
        )


def read_frame(path: Path, n: int) -> npt.NDArray[np.uint16]:
    """Values of the n-th frame of a store, (rows, W), DN."""
    group: Any = zarr.open_group(path, mode="r")
    return np.asarray(group["values"][n, : int(group["rows"][n])])
