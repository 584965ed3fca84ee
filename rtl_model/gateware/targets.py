"""FPGA boards for the Verilog: device, pins, clock and loader; and what of a build a board can
take.

The clock must allow the baud of the serial line, by an integer divider. The memories of a build are
counted in block RAMs in closed form, and reduced to the size of the device. Each memory of the
Verilog has one write and one read port and is placed in block RAM. A block of 18 kbit has one of
_SHAPES. They are the same for an ECP5 (Lattice FPGA-DS-02012, sysMEM block configurations) and for
half a 36 kbit block of the 7 series (Xilinx UG473, simple dual port). The bits of a memory are
divided into columns of blocks, with the shapes that need the fewest blocks. Tests show that yosys
0.23 needs the same number. Another tool may need more.

Sources of the table:
- Pins, parts and speed grades: litex-boards, litex_boards/platforms/radiona_ulx3s.py,
  colorlight_i5.py (revision 7.0), gsd_orangecrab.py (revision 0.2; serial on its Feather pins 0 and
  1) and digilent_arty.py; the Arty's agree with Digilent's own Arty-A7-*-Master.xdc.
- Names of boards for the loader: openFPGALoader, doc/boards.yml. The OrangeCrab's bootloader takes
  a DFU file instead, marked with 1209:5af0 (litex-boards, create_programmer).
- ECP5: Lattice FPGA-DS-02012, table 1.1: 12, 24, 44 and 84 thousand LUTs, 32, 56, 108 and 208 block
  RAMs of 18 kbit; a slice has two LUTs and two flip-flops. Where the table rounds, the exact number
  is that of nextpnr's database of the die. The 12F is the die of the 25F, sold as half of it, and
  the table's smaller numbers are taken.
- 7 series: Xilinx DS180, table of the Artix-7: 5 200 and 15 850 slices of four LUTs and eight
  flip-flops; 50 and 135 block RAMs of 36 kbit, each of them two of 18 kbit.
- JTAG identities of ECP5 devices: Project Trellis, devices.json.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host import BAUD_MIN

GatewareFamily = Literal["ecp5", "xc7"]
"""Supported families of FPGAs: ECP5 by the open tools, 7 series by Vivado."""
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


class Device(NamedTuple):
    """An FPGA.

    Attributes:
        family: determines the tools.
        luts: look-up tables, of four inputs in an ECP5 and of six in a 7 series device.
        flip_flops: flip-flops of its slices.
        block_rams: block RAMs of 18 kbit; one of 36 kbit counts as two.
        option: nextpnr's name of the device, else empty.
        idcode: IDCODE for the bitstream if the die reports another device's, else empty.
    """

    family: GatewareFamily
    luts: int
    flip_flops: int
    block_rams: int
    option: str = ""
    idcode: str = ""


class Target(NamedTuple):
    """A board.

    Attributes:
        name: name on the command line.
        board: its common name.
        device: the FPGA.
        part: the device's ordering code, with package and speed grade.
        package: name in nextpnr; for a Xilinx device the part of `part`.
        speed: grade.
        pin_hz: clock at the pin, Hz.
        divide: factor by which the top module divides it.
        clock, tx, rx, led: pins; the FPGA drives tx.
        led_low: whether a low level lights the LED.
        serial: connector of the serial line.
        loader: the board's name in openFPGALoader; empty if DFU loads it.
        io_standard: I/O standard of all pins, 3.3 V CMOS.
    """

    name: str
    board: str
    device: Device
    part: str
    package: str
    speed: str
    pin_hz: int
    divide: int
    clock: str
    tx: str
    rx: str
    led: str
    led_low: bool
    serial: str
    loader: str
    io_standard: str = "LVCMOS33"

    @property
    def clock_hz(self) -> int:
        """Clock of the design, parameter CLOCK_HZ, Hz."""
        return self.pin_hz // self.divide

    @property
    def dfu(self) -> str:
        """USB vendor and product of a board that DFU loads, else empty."""
        return "" if self.loader else "1209:5af0"


_ECP5 = {
    "12F": Device("ecp5", 12_000, 12_000, 32, "12k", "0x21111043"),
    "25F": Device("ecp5", 24_288, 24_288, 56, "25k"),
    "45F": Device("ecp5", 43_848, 43_848, 108, "45k"),
    "85F": Device("ecp5", 83_640, 83_640, 208, "85k"),
}

_A35T = Device("xc7", 4 * 5_200, 8 * 5_200, 2 * 50)

_A100T = Device("xc7", 4 * 15_850, 8 * 15_850, 2 * 135)


def _ulx3s(size: str) -> Target:
    return Target(
        f"ulx3s-{size.lower()}", f"Radiona ULX3S {size}", _ECP5[size], f"LFE5U-{size}-6BG381C",
        "CABGA381", "6", 25_000_000, 1, clock="G2", tx="L4", rx="M1", led="B2", led_low=False,
        serial="the USB connector US1", loader="ulx3s",
    )  # fmt: skip


def _arty(name: str, device: Device, part: str, loader: str) -> Target:
    return Target(
        name, f"Digilent Arty A7-{name.split('-')[-1]}T", device, part,
        "csg324", part.split("csg324-")[1], 100_000_000, 2, clock="E3", tx="D10", rx="A9", led="H5",
        led_low=False, serial="the USB connector J10", loader=loader,
    )  # fmt: skip


_ALL = (
    *map(_ulx3s, _ECP5),
    Target(
        "colorlight-i5", "Colorlight i5 7.0 on its extension board", _ECP5["25F"],
        "LFE5U-25F-6BG381C", "CABGA381", "6", 25_000_000, 1, clock="P3", tx="J17", rx="H18",
        led="U16", led_low=True, serial="the extension board's USB connector",
        loader="colorlight-i5",
    ),
    Target(
        "orangecrab-25f", "OrangeCrab 0.2 25F", _ECP5["25F"], "LFE5U-25F-8MG285C", "CSFBGA285",
        "8", 48_000_000, 1, clock="A9", tx="M18", rx="N17", led="M3", led_low=True,
        serial="Feather pins 1 (from the board) and 0, through an adapter of 3.3 V", loader="",
    ),
    _arty("arty-a7-35", _A35T, "xc7a35ticsg324-1L", "arty_a7_35t"),
    _arty("arty-a7-100", _A100T, "xc7a100tcsg324-1", "arty_a7_100t"),
)  # fmt: skip

TARGETS: dict[str, Target] = {target.name: target for target in _ALL}
"""All targets by name."""


def target_named(name: str) -> Target:
    """The target of a name. Raises InputError for an unknown name."""
    if name not in TARGETS:
        raise InputError(
            "the target", f"one of {', '.join(TARGETS)}", repr(name[:60]),
            "choose one, or see docs/fpga.md for another board",
        )  # fmt: skip
    return TARGETS[name]


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
