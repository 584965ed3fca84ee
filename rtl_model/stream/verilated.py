"""The Verilog of a source with its stream, stepped with one row of numbers a clock."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rtl_model.geometry import Geometry
from rtl_model.verilated import VerilatedModule, library

_STREAM = ("valid", "data", "last", "user", "lost_planes", "lost_rows")
COLUMNS: dict[str, tuple[str, ...]] = {
    "array": _STREAM,
    "external": (
        *_STREAM, "frames", "late", "command", "write", "address", "low", "middle", "high",
    ),
    "lines": (*_STREAM, "aligned", "losses", "bad_rows", "missed_rows"),
}  # fmt: skip
"""Outputs of each source, in the order in which the shims write them."""

Numbers = npt.NDArray[np.uint64]


class VerilatedStream(VerilatedModule):
    """`viform_stream_array`, `_external` or `_lines` in Verilator.

    Args:
        source: "array", "external" or "lines".
        geometry: geometry of the build.
        settings: further parameters: DEPTH, and of "external" PIXELS and IN_FLIGHT.
        sources: folder of the Verilog; the design's if None.
        memory: contents of the memory of "external".
        latency: latency of that memory, clocks from a command to its word, at least 1.

    Raises:
        InputError: if Verilator is missing.
        BuildFailed: if the Verilog does not compile.
    """

    def __init__(
        self,
        source: str,
        geometry: Geometry,
        settings: dict[str, int],
        *,
        sources: Path | None = None,
        memory: list[int] | None = None,
        latency: int = 1,
    ) -> None:
        shim = Path(__file__).with_name(f"{source}.cpp")
        path = library(
            f"viform_stream_{source}", geometry, shim, sources=sources, settings=settings
        )
        super().__init__(path)
        number, pointer = ctypes.c_uint64, ctypes.c_void_p
        self._library.viform_steps.argtypes = [pointer, pointer, pointer, number]
        self._columns = len(COLUMNS[source])
        assert self._library.viform_outputs() == self._columns
        if memory is not None:
            self._library.viform_memory.argtypes = [pointer, pointer, number, number]
            parts = [[word >> 64 * n & (1 << 64) - 1 for n in range(3)] for word in memory]
            words = np.array(parts, np.uint64)
            self._library.viform_memory(self._board, words.ctypes.data, len(words), latency)

    def run(self, inputs: Numbers) -> Numbers:
        """Steps one clock a row.

        Args:
            inputs: (clocks, inputs) uint64, in the order of the shim.

        Returns:
            (clocks, outputs) uint64: `COLUMNS` before each edge. Outputs without meaning, such as
            data without valid, are 0.
        """
        assert inputs.shape[1] == self._library.viform_inputs()
        given = np.ascontiguousarray(inputs, np.uint64)
        out = np.empty((len(given), self._columns), np.uint64)
        self._library.viform_steps(self._board, given.ctypes.data, out.ctypes.data, len(given))
        return out
