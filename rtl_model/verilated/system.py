"""The verilated system, with the interface of `cycle.System`: timed writes in, tiles out; and any
module in Verilator behind its shim, from its reset to its end.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.cycle.array import TILE, Tiles
from rtl_model.geometry import Geometry
from rtl_model.verilated.build import Trace, library

SHIM = Path(__file__).with_name("system.cpp")
_ROOM = 1 << 16  # tiles of one call
_WRITE = np.dtype([("clock", "<u8"), ("address", "<u4"), ("value", "<u4")])
_NO_WRITES = np.empty(0, _WRITE)
_READ_CLOCKS = 2


class VerilatedModule:
    """One instance of a library that `build.library` has built; a context that ends it.

    Subclasses declare the shim's other functions on `_library`, whose first argument is `_board`.

    Args:
        path: path of the library.
    """

    def __init__(self, path: Path) -> None:
        self._library: Any = ctypes.CDLL(str(path))
        self._library.viform_open.restype = ctypes.c_void_p
        self._library.viform_close.argtypes = [ctypes.c_void_p]
        self._board: int | None = self._library.viform_open()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Ends the model and completes its waveforms; may be called twice."""
        board, self._board = getattr(self, "_board", None), None
        if board is not None:
            self._library.viform_close(board)


class VerilatedSystem(VerilatedModule):
    """`viform_system` in Verilator. Clock n is the n-th edge after reset.

    Args:
        geometry, sources, build: geometry, sources and build as in `build.library`.
        waves: waveforms to write, None for none. The file is complete when the system is closed.

    Raises:
        InputError: if Verilator is missing or the waveforms cannot be written.
    """

    def __init__(
        self,
        geometry: Geometry,
        *,
        sources: Path | None = None,
        build: int = 0,
        waves: Waves | None = None,
    ) -> None:
        self.geometry = geometry
        trace: Trace = "" if waves is None else waves.format
        path = library("viform_system", geometry, SHIM, sources=sources, trace=trace, build=build)
        super().__init__(path)
        _declare(self._library)
        self._clock = 0
        self._tiles: list[Tiles] = []
        self._sink_tiles: list[Tiles] = []
        self._buffers = np.empty((2, _ROOM), TILE)
        self._pointers = [buffer.ctypes.data for buffer in self._buffers]
        self._counts = (ctypes.c_uint64 * 3)()
        if waves is not None and not self._library.viform_waves(
            self._board, str(waves.path).encode(), waves.first, waves.last
        ):
            self.close()
            raise InputError(
                f"{waves.path}", "a file that can be written", "refused", "choose another name"
            )

    @property
    def clock(self) -> int:
        """Edges passed since reset."""
        return self._clock

    def write(self, address: int, value: int) -> None:
        """Writes 32 bits at a byte address; takes one clock."""
        self._advance(self._clock + 1, np.array([(self._clock, address, value)], _WRITE))

    def read(self, address: int) -> int:
        """The 32 bits at a byte address at this clock; takes two clocks."""
        word = self._library.viform_read(self._board, address, *self._pointers, self._counts)
        self._clock += _READ_CLOCKS
        self._keep()
        if word < 0:
            raise RuntimeError(f"no word {_READ_CLOCKS} clocks after a read of 0x{address:x}")
        return int(word)

    def run(self, clocks: int, writes: Iterable[tuple[int, int, int]] = ()) -> Tiles:
        """Runs `clocks` clocks; returns the tiles computed since the last run.

        Args:
            clocks: number of clocks.
            writes: (clock, byte address, value) at clocks of this run, at most one each.

        Raises:
            InputError: for a write at another clock.
        """
        stop = self._clock + clocks
        due = np.array(list(writes), dtype=np.int64).reshape(-1, 3)
        due = due[np.argsort(due[:, 0], kind="stable")]
        clock = due[:, 0]
        wrong = (clock < self._clock) | (clock >= stop)
        wrong[1:] |= clock[1:] == clock[:-1]
        if wrong.any():
            raise InputError(
                "a write's clock",
                f"one of {self._clock} to {stop - 1}, one write a clock",
                str(clock[wrong.argmax()]),
                "move the write",
            )
        batch = np.empty(len(due), _WRITE)
        batch["clock"], batch["address"], batch["value"] = due.T
        self._advance(stop, batch)
        return _joined(self._tiles)

    def sink_tiles(self) -> Tiles:
        """The tiles that the sink displayed since the last call; their frame is 0."""
        return _joined(self._sink_tiles)

    def _advance(self, stop: int, writes: npt.NDArray[np.void] | None = None) -> None:
        left = _NO_WRITES if writes is None else writes
        while self._clock < stop:
            self._clock = self._library.viform_run(
                self._board, stop, left.ctypes.data, len(left), *self._pointers, _ROOM, self._counts
            )
            self._keep()
            left = left[self._counts[2] :]

    def _keep(self) -> None:
        lists = self._tiles, self._sink_tiles
        for tiles, buffer, count in zip(lists, self._buffers, self._counts, strict=False):
            if count:
                tiles.append(buffer[:count].copy())


class Waves:
    """Waveforms to write.

    Attributes:
        path: file.
        first, last: first clock, and the clock after the last one.
        format: format of the file.
    """

    def __init__(self, path: Path, first: int = 0, last: int = 1 << 62) -> None:
        self.path, self.first, self.last = path, first, last
        self.format = trace_format(path)


def trace_format(path: Path) -> Trace:
    """Format of waveforms by the file's ending. Raises InputError for another ending."""
    endings: dict[str, Trace] = {".fst": "fst", ".vcd": "vcd"}
    if path.suffix.lower() not in endings:
        raise InputError(
            f"{path}", "a name that ends in .fst or .vcd", f"{path.suffix!r}", "rename it"
        )
    return endings[path.suffix.lower()]


def _joined(parts: list[Tiles]) -> Tiles:
    tiles = np.concatenate(parts) if parts else np.empty(0, TILE)
    parts.clear()
    return tiles


def _declare(loaded: Any) -> None:
    loaded.viform_run.restype = ctypes.c_uint64
    loaded.viform_run.argtypes = [
        ctypes.c_void_p,
        ctypes.c_uint64,
        ctypes.c_void_p,
        ctypes.c_uint64,
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_uint64,
        ctypes.c_void_p,
    ]
    loaded.viform_read.restype = ctypes.c_int64
    loaded.viform_read.argtypes = [
        ctypes.c_void_p,
        ctypes.c_uint32,
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_void_p,
    ]
    if hasattr(loaded, "viform_waves"):
        loaded.viform_waves.argtypes = [
            ctypes.c_void_p,
            ctypes.c_char_p,
            ctypes.c_uint64,
            ctypes.c_uint64,
        ]
