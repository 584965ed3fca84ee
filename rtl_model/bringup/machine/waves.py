"""Waveforms of a virtual board: its Verilog for a few frames, in lockstep with the cycle model.

The simulators are imported in the function that needs them, because they take seconds to load.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from cosim import InputError
from cosim.run.folder import check_trace_file
from rtl_model.bringup.machine.image import make_image
from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS

__all__ = ["Trace", "checked_trace", "write_waves"]

_FRAMES = 2


class Trace(NamedTuple):
    """Where waveforms are written, and of which build.

    Attributes:
        path: file.
        geometry: of the build.
    """

    path: Path
    geometry: Geometry


def checked_trace(path: Path | None, geometry: Geometry | None) -> Trace | None:
    """Checks the file of `--trace`; None if there is none.

    Args:
        path: file, None for none.
        geometry: of the virtual board, None for a real one.

    Raises InputError for a real board, another file ending, or a missing folder.
    """
    if path is None:
        return None
    if geometry is None:
        raise InputError(
            "--trace", "given with board.port=virtual", "with a real board",
            "leave it out: the internal signals of a real board are not on its line",
        )  # fmt: skip
    check_trace_file(path)
    return Trace(path, geometry)


def write_waves(trace: Trace, seed: int) -> None:
    """Writes the waveforms of the first frames under the image of `seed`.

    Raises RuntimeError if the Verilog's tiles differ from the cycle model's.
    """
    from rtl_model.cycle import System
    from rtl_model.verilated import VerilatedSystem, Waves

    geometry = trace.geometry
    address = {entry.name: entry.address for entry in REGISTERS}
    base = next(memory.address for memory in MEMORIES if memory.name == "pattern_mem")
    padded = np.zeros((geometry.rows, geometry.tiles * geometry.lanes), np.uint8)
    padded[:, : geometry.columns] = make_image(geometry, seed)
    words = padded.view("<u4").reshape(-1)
    writes = [(n, base + 4 * n, int(word)) for n, word in enumerate(words)]
    start = len(writes)
    writes += [
        (start, address["sensor_threshold"], 0),
        (start + 1, address["sensor_run"], 1),
    ]
    clocks = start + 2 + _FRAMES * geometry.tick_clocks
    with VerilatedSystem(geometry, waves=Waves(trace.path, start, clocks)) as verilog:
        tiles = verilog.run(clocks, writes)
    if not np.array_equal(tiles, System(geometry).run(clocks, writes)):
        raise RuntimeError("the Verilog's tiles differ from the cycle model's")
