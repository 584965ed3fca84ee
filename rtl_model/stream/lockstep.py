"""Runs the Verilog of a source with its stream beside the cycle model, on the same inputs.

Both sides take one row of numbers a clock and give one. Outputs are `COLUMNS`, and the inputs those
of the shims.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rtl_model.cycle import Settings, System
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS
from rtl_model.stream.external import ExternalArray, Memory
from rtl_model.stream.lines import Lines
from rtl_model.stream.program import Case
from rtl_model.stream.ring import Beat, Ring, Tile
from rtl_model.verilated import VerilatedModule, library

Numbers = npt.NDArray[np.uint64]
_RESET = next(entry.address for entry in REGISTERS if entry.name == "ctrl_reset")
_WORD = (1 << 64) - 1
_STREAM = ("valid", "data", "last", "user", "lost_planes", "lost_rows")
COLUMNS: dict[str, tuple[str, ...]] = {
    "array": _STREAM,
    "external": (
        *_STREAM, "frames", "late", "command", "write", "address", "low", "middle", "high",
    ),
    "lines": (*_STREAM, "aligned", "losses", "bad_rows", "missed_rows"),
}  # fmt: skip
"""Outputs of each source, in the order in which the shims write them."""


class Outcome(NamedTuple):
    """Result of a run.

    Attributes:
        clocks: number of clocks that were compared.
        outputs: outputs of the model, (clocks, outputs) uint64.
        difference: first clock at which an output differs: clock, output, Verilog, model; None if
            there is none.
    """

    clocks: int
    outputs: Numbers
    difference: tuple[int, str, int, int] | None


def run(case: Case, *, sources: Path | None = None) -> Outcome:
    """Compares all outputs at every clock.

    Args:
        case: the source and its inputs.
        sources: folder of the Verilog; the design's if None.
    """
    model = model_outputs(case)
    memory = case.memory if case.source == "external" else None
    with VerilatedStream(
        case.source, case.geometry, case.settings, sources=sources, memory=memory,
        latency=case.latency,
    ) as verilog:  # fmt: skip
        found = verilog.run(case.inputs)
    wrong = np.argwhere(found != model)
    if not len(wrong):
        return Outcome(len(model), model, None)
    clock, column = wrong[0].tolist()
    values = int(found[clock, column]), int(model[clock, column])
    return Outcome(clock, model, (clock, COLUMNS[case.source][column], *values))


def beats(case: Case, outputs: Numbers) -> list[Beat]:
    """The transfers in outputs: where TVALID and TREADY are high."""
    taken = (outputs[:, 0] == 1) & (case.inputs[:, 0] == 1)
    return [Beat(data, bool(last), user) for data, last, user in outputs[taken][:, 1:4].tolist()]


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


def model_outputs(case: Case) -> Numbers:
    """The outputs of the cycle model, (clocks, outputs) uint64, in the order of `COLUMNS`."""
    size, settings, inputs = case.geometry, case.settings, case.inputs
    if case.source == "array":
        return array_outputs(size, settings, inputs)
    if case.source == "external":
        return external_outputs(size, settings, inputs, case.memory, case.latency)
    return lines_outputs(size, settings, inputs)


def array_outputs(geometry: Geometry, settings: Mapping[str, int], inputs: Numbers) -> Numbers:
    """The stream of the emulated pixels.

    Args:
        geometry: geometry of the build.
        settings: DEPTH.
        inputs: (clocks, 4): ready, whether the bus writes, byte address, value.
    """
    writes = [
        (clock, int(inputs[clock, 2]), int(inputs[clock, 3]))
        for clock in np.flatnonzero(inputs[:, 1]).tolist()
    ]
    resets = {clock for clock, address, value in writes if address & ~3 == _RESET and value & 1}
    tiles = System(geometry).run(len(inputs), writes)
    at_pins = {
        int(tile["clock"]) + 1: Tile(
            *(int(tile[name]) for name in ("frame", "row", "tile", "bits"))
        )
        for tile in tiles
    }
    ring, rows = Ring(geometry.tiles, settings["DEPTH"]), []
    for clock, ready in enumerate(inputs[:, 0].tolist()):
        rows.append(_stream(ring))
        if clock in resets:
            ring.reset()
        else:
            ring.edge(at_pins.get(clock), bool(ready))
    return np.array(rows, np.uint64)


def external_outputs(
    geometry: Geometry,
    settings: Mapping[str, int],
    inputs: Numbers,
    memory: list[int],
    latency: int,
) -> Numbers:
    """The stream of pixels in an external memory, and the memory's commands.

    Args:
        geometry: geometry of the array.
        settings: DEPTH, PIXELS and IN_FLIGHT.
        inputs: (clocks, 12): ready, ready of the memory, run, clear, threshold, clock select, reset
            rule, rows, columns, tick, pattern, level.
        memory, latency: memory and latency as in `external.Memory`.
    """
    array = ExternalArray(geometry, settings["PIXELS"], settings["IN_FLIGHT"])
    store = Memory(memory, latency)
    ring, rows = Ring(geometry.tiles, settings["DEPTH"]), []
    for (
        ready,
        taken,
        run,
        clear,
        level_q,
        select,
        rule,
        window,
        span,
        tick,
        kind,
        level,
    ) in inputs.tolist():
        command = array.command
        numbers = [0] * 6
        if command is not None:
            parts = [command.data >> 64 * n & _WORD for n in range(3)]
            numbers = [1, int(command.write), command.address, *parts]
        rows.append([*_stream(ring), array.frames, array.late, *numbers])
        registers = Settings(
            threshold=level_q,
            clock_select=select,
            reset_rule=rule,
            rows=(window & 0xFFFF, window >> 16),
            columns=(span & 0xFFFF, span >> 16),
            pattern=kind,
            level=level,
        )
        ring.edge(array.tile, bool(ready))
        array.edge(bool(run), bool(clear), tick, registers, store.arriving, bool(taken))
        store.edge(command if taken else None)
    return np.array(rows, np.uint64)


def lines_outputs(geometry: Geometry, settings: Mapping[str, int], inputs: Numbers) -> Numbers:
    """The stream of a sensor's data lanes.

    Args:
        geometry: geometry of the sensor.
        settings: DEPTH.
        inputs: (clocks, 2): ready, bits of all lanes, the first lane in the lowest eight.
    """
    lines = Lines(geometry)
    ring, rows = Ring(geometry.tiles, settings["DEPTH"]), []
    for ready, bits in inputs.tolist():
        aligned = sum(lane.aligned << n for n, lane in enumerate(lines.lanes))
        rows.append([*_stream(ring), aligned, lines.losses, lines.bad_rows, lines.missed_rows])
        ring.edge(lines.tile, bool(ready))
        lines.edge([bits >> 8 * n & 0xFF for n in range(len(lines.lanes))])
    return np.array(rows, np.uint64)


def _stream(ring: Ring) -> list[int]:
    beat = ring.beat
    offered = [0] * 4 if beat is None else [1, beat.data, int(beat.last), beat.user]
    return [*offered, ring.lost_planes, ring.lost_rows]
