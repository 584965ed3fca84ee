"""Block RAMs of a build in closed form, and reduction of its memories to the size of a device.

Each memory of the Verilog has one write and one read port and is placed in block RAM. A block of 18
kbit has one of the shapes below. They are the same for an ECP5 (Lattice FPGA-DS-02012, sysMEM block
configurations) and for half a 36 kbit block of the 7 series (Xilinx UG473, simple dual port). The
bits of a memory are divided into columns of blocks, with the shapes that need the fewest blocks.
Tests show that yosys 0.23 needs the same number. Another tool may need more.
"""

from __future__ import annotations

from cosim import InputError
from rtl_model.gateware.targets import Target
from rtl_model.geometry import Geometry

_SHAPES = ((512, 36), (1024, 18), (2048, 9), (4096, 4), (8192, 2), (16384, 1))  # words, bits
_FEWEST_WORDS = 256  # smallest capture and sink memory after a reduction


def block_rams(geometry: Geometry) -> int:
    """Smallest number of 18 kbit block RAMs that the memories of the build need."""
    depth = geometry.rows * geometry.tiles
    groups = geometry.lanes // 4  # viform_pixels.v: 8 bits of pattern, 12 of charge, four pixels
    banks = geometry.lanes // 32  # viform_sink.v
    return (
        groups * (_blocks(depth, 32) + _blocks(depth, 48))
        + _blocks(depth * groups, 32)  # copy that the bus reads
        + _blocks(geometry.tiles, geometry.lanes)  # row buffer of the capture memory
        + _blocks(geometry.capture_words, 32)
        + banks * _blocks(geometry.sink_words // banks, 32)
    )


def fitted(geometry: Geometry, target: Target) -> Geometry:
    """The geometry with capture memory, then sink, halved until the build fits the device.

    The capture memory holds at least one frame. Raises InputError if the build does not fit.
    """
    most, cut = target.device.block_rams, geometry
    frame = geometry.rows * geometry.record_words
    while block_rams(cut) > most and cut.capture_words // 2 >= max(frame, _FEWEST_WORDS):
        cut = cut._replace(capture_words=cut.capture_words // 2)
    while block_rams(cut) > most and cut.sink_words // 2 >= _FEWEST_WORDS:
        cut = cut._replace(sink_words=cut.sink_words // 2)
    if block_rams(cut) > most:
        raise InputError(
            f"{geometry.rows} x {geometry.columns} pixels in {geometry.lanes} lanes",
            f"of a size that fits the {most} block RAMs (18 kbit) of {target.part}",
            f"one that needs {block_rams(cut)} with the smallest memories",
            "give fewer --rows or --columns, or take a larger target",
        )
    return cut


def _blocks(words: int, bits: int) -> int:
    """Smallest number of blocks for `words` words of `bits` bits."""
    fewest = [0]  # for 0, 1, ... bits
    for wanted in range(1, bits + 1):
        fewest.append(
            min(-(-words // deep) + fewest[max(0, wanted - wide)] for deep, wide in _SHAPES)
        )
    return fewest[bits]
