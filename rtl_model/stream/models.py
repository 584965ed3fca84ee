"""The cycle models behind the pins of the Verilog: one row of numbers a clock in, one out.

The columns are those of `verilated.COLUMNS`, and the inputs those of the shims.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from rtl_model.cycle import Settings, System
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS
from rtl_model.stream.external import ExternalArray, Memory
from rtl_model.stream.lines import Lines
from rtl_model.stream.ring import Ring, Tile

_RESET = next(entry.address for entry in REGISTERS if entry.name == "ctrl_reset")
_WORD = (1 << 64) - 1

Numbers = npt.NDArray[np.uint64]


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
