"""Whether a build fits a target: its baud, derived from the clock by an integer divider, and its
memories, counted in block RAMs in closed form and reduced to the size of the device.

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
from rtl_model.host import BAUD_MIN

TOLERANCE = 0.02
"""Largest relative error of a baud. Sender and receiver may differ by half a bit in 9.5, 5.3 %
(viform_uart.v). This leaves the larger part to the adapter and to the rounding of the edge."""
_FEWEST_CLOCKS = 4  # of a bit; its middle is undefined with fewer (HALF in viform_uart.v)
_COMMON = (
    9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 921_600, 1_000_000,
    1_500_000, 2_000_000, 2_500_000, 3_000_000, 4_000_000, 6_000_000, 8_000_000, 12_000_000,
)  # fmt: skip
"""Rates of common adapters: those of POSIX, of Linux's termios.h, and of an FT2232H."""
_SHAPES = ((512, 36), (1024, 18), (2048, 9), (4096, 4), (8192, 2), (16384, 1))  # words, bits
_FEWEST_WORDS = 256  # smallest capture and sink memory after a reduction


def check_baud(clock_hz: int, baud: int) -> None:
    """Raises InputError for a baud whose error exceeds `TOLERANCE`.

    The message names the nearest common rates within the tolerance.
    """
    if baud < BAUD_MIN:
        raise InputError(
            "--baud", f"at least {BAUD_MIN}, for the board drops a transaction after 100 ms",
            str(baud), "take 115200",
        )  # fmt: skip
    if _good(clock_hz, baud):
        return
    below = [rate for rate in _COMMON if rate < baud and _good(clock_hz, rate)]
    above = [rate for rate in _COMMON if rate > baud and _good(clock_hz, rate)]
    near = " or ".join(map(str, below[-1:] + above[:1]))
    megahertz = f"{clock_hz / 1e6:g} MHz"
    if clock_hz < _FEWEST_CLOCKS * baud:
        actual = f"{baud}, which leaves less than {_FEWEST_CLOCKS} clocks a bit"
    else:
        clocks = Geometry(clock_hz=clock_hz, baud=baud).bit_clocks
        off = 100 * baud_error(clock_hz, baud)
        actual = f"{baud}, for which {clocks} clocks a bit are off by {off:+.1f} %"
    raise InputError(
        "--baud", f"a rate that {megahertz} allows within {100 * TOLERANCE:g} %", actual,
        f"take {near}",
    )  # fmt: skip


def baud_error(clock_hz: int, baud: int) -> float:
    """Signed relative error of the rate of the nearest integer divider."""
    return clock_hz / Geometry(clock_hz=clock_hz, baud=baud).bit_clocks / baud - 1.0


def _good(clock_hz: int, baud: int) -> bool:
    return clock_hz >= _FEWEST_CLOCKS * baud and abs(baud_error(clock_hz, baud)) <= TOLERANCE


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


def _blocks(words: int, bits: int) -> int:
    """Smallest number of blocks for `words` words of `bits` bits."""
    fewest = [0]  # for 0, 1, ... bits
    for wanted in range(1, bits + 1):
        fewest.append(
            min(-(-words // deep) + fewest[max(0, wanted - wide)] for deep, wide in _SHAPES)
        )
    return fewest[bits]
