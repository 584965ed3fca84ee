"""FPGA boards for the Verilog: device, pins, clock and loader.

Sources:
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

GatewareFamily = Literal["ecp5", "xc7"]
"""Supported families of FPGAs: ECP5 by the open tools, 7 series by Vivado."""


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
