"""Waveforms of a virtual board: its Verilog for a few frames, in lockstep with the cycle model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim import InputError
from cosim.run.folder import check_trace_file
from rtl_model.bringup.frames import uploaded_image
from rtl_model.geometry import Geometry

__all__ = ["check_trace", "write_waves"]

_FRAMES = 2


def check_trace(trace: Path | None, geometry: Geometry | None) -> None:
    """InputError for waveforms that cannot be had: of a real board (`geometry` None), by another
    ending, or into no folder."""
    if trace is None:
        return
    if geometry is None:
        raise InputError(
            "--trace", "given with board.port=virtual", "with a real board",
            "leave it out: the insides of a real board are not seen over its line",
        )  # fmt: skip
    check_trace_file(trace)


def write_waves(trace: Path, geometry: Geometry, seed: int) -> None:
    """Writes the waveforms of the first frames under the image of `seed`. RuntimeError where the
    Verilog's tiles are not the cycle model's, which the run would have shown before."""
    from rtl_model.cycle import System
    from rtl_model.registers import MEMORIES, REGISTERS
    from rtl_model.verilated import VerilatedSystem, Waves

    address = {entry.name: entry.address for entry in REGISTERS}
    base = next(memory.address for memory in MEMORIES if memory.name == "pattern_mem")
    wide = np.zeros((geometry.rows, geometry.tiles * geometry.lanes), np.uint8)
    wide[:, : geometry.columns] = uploaded_image(geometry, seed)
    words = wide.view("<u4").reshape(-1)
    writes = [(n, base + 4 * n, int(word)) for n, word in enumerate(words)]
    start = len(writes)
    writes += [
        (start, address["sensor_threshold"], 0),
        (start + 1, address["sensor_run"], 1),
    ]
    clocks = start + 2 + _FRAMES * geometry.tick_clocks
    with VerilatedSystem(geometry, waves=Waves(trace, start, clocks)) as verilog:
        made = verilog.run(clocks, writes)
    if not np.array_equal(made, System(geometry).run(clocks, writes)):
        raise RuntimeError("the Verilog's tiles are not the cycle model's")
