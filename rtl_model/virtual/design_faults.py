"""Faults of the design, injected into a copy of the Verilog or into the cycle model."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from cosim import InputError
from rtl_model.cycle import System, Tiles
from rtl_model.cycle import scan as _scan
from rtl_model.cycle.array import PixelArray
from rtl_model.geometry import Geometry
from rtl_model.registers import MAGIC, REGISTERS
from rtl_model.virtual.faults import Faults

FOREIGN_MAGIC = 0x4C695465
"""ASCII "LiTe": the magic word of another design."""

_MAGIC_ADDRESS = next(entry.address for entry in REGISTERS if entry.name == "ctrl_magic")
_MAGIC_LINE = f"`define VIFORM_CTRL_MAGIC_RESET 32'h{MAGIC:08x}"
_BITS = ".bits(tile_bits["
_BEFORE = "    genvar group;"


def inject_faults(verilog: Path, folder: Path, geometry: Geometry, faults: Faults) -> None:
    """Copies the Verilog of one folder to another and injects the faults of the design.

    A stuck bit is one of `tile_bits`, so the counted and the captured spikes are wrong alike.
    Raises InputError if the Verilog has no unique place for a fault.

    Args:
        verilog: folder of the sources.
        folder: existing folder for the copy.
        geometry: geometry of the build.
        faults: faults, of which those of the design are injected.
    """
    from rtl_model.verilated import verilog_files  # not needed by the cycle model

    for path in verilog_files(verilog):
        shutil.copyfile(path, folder / path.name)
    if faults.foreign:
        line = _MAGIC_LINE.replace(f"{MAGIC:08x}", f"{FOREIGN_MAGIC:08x}")
        _replace(folder / "viform_registers.vh", _MAGIC_LINE, line)
    if faults.stuck:
        text = "    wire [LANES-1:0] pixels_bits;\n    wire [63:0] sound = {64'd0 | pixels_bits};\n"
        value = "sound"
        for row, column, bit in faults.stuck:
            tile, lane = divmod(column, geometry.lanes)
            mask = f"(64'd{1 << lane})"
            here = f"(tile_row == 16'd{row} && tile_index == 16'd{tile} ? {mask} : 64'd0)"
            value = f"({value} | {here})" if bit else f"({value} & ~{here})"
        text += f"    wire [63:0] faulty = {value};\n    assign tile_bits = faulty[LANES-1:0];\n"
        sensor = folder / "viform_sensor.v"
        _replace(sensor, _BITS, ".bits(pixels_bits[")
        _replace(sensor, _BEFORE, text + _BEFORE)


def _replace(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    if text.count(old) != 1:
        raise InputError(
            f"{path.name}",
            f"Verilog that contains {old!r} once",
            f"{text.count(old)} times",
            "adapt rtl_model/virtual/design_faults.py to the Verilog",
        )
    path.write_text(text.replace(old, new), encoding="utf-8")


class FaultySystem(System):
    """The cycle model with faults of the design."""

    def __init__(self, geometry: Geometry, faults: Faults, *, keep: bool = True) -> None:
        super().__init__(geometry, keep=keep)
        self._foreign = faults.foreign
        if faults.stuck:
            self._array = _StuckArray(geometry, faults)

    def read(self, address: int) -> int:
        """The 32 bits at a byte address; takes two clocks."""
        value = super().read(address)
        return FOREIGN_MAGIC if self._foreign and address & ~3 == _MAGIC_ADDRESS else value


class _StuckArray(PixelArray):
    """A pixel array with stuck output bits."""

    def __init__(self, geometry: Geometry, faults: Faults) -> None:
        super().__init__(geometry)
        self._stuck = faults.stuck

    def run(self, clock: int, stop: int) -> Tiles:
        tiles = super().run(clock, stop)
        before = np.bitwise_count(tiles["bits"])
        for row, column, bit in self._stuck:
            tile, lane = divmod(column, self.geometry.lanes)
            here = (tiles["row"] == row) & (tiles["tile"] == tile)
            mask = np.uint64(1 << lane)
            bits = tiles["bits"][here]
            tiles["bits"][here] = bits | mask if bit else bits & ~mask
        if self.passing:  # whose bits are no spikes
            return tiles
        more = np.bitwise_count(tiles["bits"]).astype(np.int64) - before
        self._state[_scan.SPIKES] = (self._state[_scan.SPIKES] + int(more.sum())) & 0xFFFFFFFF
        if tiles.size and tiles["clock"][-1] == self._state[_scan.LAST]:
            self._state[_scan.LAST_SPIKES] += int(more[-1])
        return tiles
