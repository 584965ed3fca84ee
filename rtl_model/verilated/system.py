"""The verilated system, stepped as `cycle.System` is: writes at their clocks, tiles out."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.cycle.tiles import TILE, Tiles
from rtl_model.geometry import Geometry
from rtl_model.verilated.build import Trace, library

__all__ = ["SHIM", "VerilatedSystem", "Waves", "trace_format"]

SHIM = Path(__file__).with_name("system.cpp")

_ROOM = 1 << 16  # tiles of one call
_WRITE = np.dtype([("clock", "<u8"), ("address", "<u4"), ("value", "<u4")])
_NO_WRITES = np.empty(0, _WRITE)
_READ_CLOCKS = 2


class Waves:
    """Where waveforms go, and of which clocks: `first` to `last` - 1."""

    def __init__(self, path: Path, first: int = 0, last: int = 1 << 62) -> None:
        self.path, self.first, self.last = path, first, last
        self.format = trace_format(path)


def trace_format(path: Path) -> Trace:
    """Returns the format of waveforms in a file by its name's ending; InputError for no known."""
    endings: dict[str, Trace] = {".fst": "fst", ".vcd": "vcd"}
    if path.suffix.lower() not in endings:
        raise InputError(
            f"{path}", "a name that ends in .fst or .vcd", f"{path.suffix!r}", "rename it"
        )
    return endings[path.suffix.lower()]


class VerilatedSystem:
    """`viform_system` in Verilator. Clock n is the n-th edge after reset.

    geometry, sources, build: as `build.library` takes them.
    waves: waveforms to write, closed with the system.

    Raises InputError where Verilator is missing or the waveforms cannot be written.
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
        self._library = _load(path)
        self._board: int | None = self._library.viform_open()
        self._clock = 0
        self._tiles: list[Tiles] = []
        self._shown: list[Tiles] = []
        self._made = np.empty((2, _ROOM), TILE)
        self._rooms = [room.ctypes.data for room in self._made]
        self._counts = (ctypes.c_uint64 * 3)()
        if waves is not None and not self._library.viform_waves(
            self._board, str(waves.path).encode(), waves.first, waves.last
        ):
            self.close()
            raise InputError(
                f"{waves.path}", "a file that can be written", "refused", "choose another name"
            )

    def __enter__(self) -> VerilatedSystem:
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
        """Ends the model and completes its waveforms."""
        board, self._board = getattr(self, "_board", None), None
        if board is not None:
            self._library.viform_close(board)

    @property
    def clock(self) -> int:
        """Edges passed since reset."""
        return self._clock

    def write(self, address: int, value: int) -> None:
        """Writes 32 bits at a byte address; takes one clock."""
        self._advance(self._clock + 1, np.array([(self._clock, address, value)], _WRITE))

    def read(self, address: int) -> int:
        """Returns the 32 bits at a byte address, as seen at this clock; takes two clocks."""
        word = self._library.viform_read(self._board, address, *self._rooms, self._counts)
        self._clock += _READ_CLOCKS
        self._keep()
        if word < 0:
            raise RuntimeError(f"no word {_READ_CLOCKS} clocks after a read of 0x{address:x}")
        return int(word)

    def run(self, clocks: int, writes: Iterable[tuple[int, int, int]] = ()) -> Tiles:
        """Runs `clocks` clocks and returns the tiles computed in them, and before them in `write`
        and `read` since the last run.

        writes: (clock, byte address, value) at clocks of this run, at most one each. InputError
            for any other.
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

    def shown(self) -> Tiles:
        """Returns what the sink showed since this was last asked, as tiles whose frame is 0."""
        return _joined(self._shown)

    def _advance(self, stop: int, writes: npt.NDArray[np.void] | None = None) -> None:
        left = _NO_WRITES if writes is None else writes
        while self._clock < stop:
            self._clock = self._library.viform_run(
                self._board, stop, left.ctypes.data, len(left), *self._rooms, _ROOM, self._counts
            )
            self._keep()
            left = left[self._counts[2] :]

    def _keep(self) -> None:
        for kept, made, count in zip(
            (self._tiles, self._shown), self._made, self._counts, strict=False
        ):
            if count:
                kept.append(made[:count].copy())


def _joined(parts: list[Tiles]) -> Tiles:
    tiles = np.concatenate(parts) if parts else np.empty(0, TILE)
    parts.clear()
    return tiles


def _load(path: Path) -> Any:
    made = ctypes.CDLL(str(path))
    made.viform_open.restype = ctypes.c_void_p
    made.viform_close.argtypes = [ctypes.c_void_p]
    made.viform_run.restype = ctypes.c_uint64
    made.viform_run.argtypes = [
        ctypes.c_void_p,
        ctypes.c_uint64,
        ctypes.c_void_p,
        ctypes.c_uint64,
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_uint64,
        ctypes.c_void_p,
    ]
    made.viform_read.restype = ctypes.c_int64
    made.viform_read.argtypes = [
        ctypes.c_void_p,
        ctypes.c_uint32,
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_void_p,
    ]
    if hasattr(made, "viform_waves"):
        made.viform_waves.argtypes = [
            ctypes.c_void_p,
            ctypes.c_char_p,
            ctypes.c_uint64,
            ctypes.c_uint64,
        ]
    return made
