"""One build for one target: its geometry, its BUILD, and the files of its folder.

This file also covers the error of a baud that is derived from a clock by an integer divider.

This file also covers the block RAMs of a build in closed form, and reduction of its memories to the
size of a device.

Each memory of the Verilog has one write and one read port and is placed in block RAM. A block of 18
kbit has one of the shapes below. They are the same for an ECP5 (Lattice FPGA-DS-02012, sysMEM block
configurations) and for half a 36 kbit block of the 7 series (Xilinx UG473, simple dual port). The
bits of a memory are divided into columns of blocks, with the shapes that need the fewest blocks.
Tests show that yosys 0.23 needs the same number. Another tool may need more.

This file also covers constraint files, with pins and clocks: Lattice's .lpf and Xilinx's .xdc.

This file also writes the folder of a design atomically.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import NamedTuple

from cosim import InputError
from cosim.files.atomic import refusal
from rtl_model.gateware.ethernet import Ethernet, Network, core_config
from rtl_model.gateware.recipe import readme, recipe
from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import CORE, TOP, ethernet_pins, ethernet_top, pins, top_module
from rtl_model.geometry import Geometry
from rtl_model.host import BAUD_MIN
from rtl_model.registers import csr_csv
from rtl_model.verilated import VERILOG, build_crc, verilog_files

TOLERANCE = 0.02
"""Largest relative error of a baud. Sender and receiver may differ by half a bit in 9.5, 5.3 %
(viform_uart.v). This leaves the larger part to the adapter and to the rounding of the edge."""

_FEWEST_CLOCKS = 4  # of a bit; its middle is undefined with fewer (HALF in viform_uart.v)
_COMMON = (
    9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 921_600, 1_000_000,
    1_500_000, 2_000_000, 2_500_000, 3_000_000, 4_000_000, 6_000_000, 8_000_000, 12_000_000,
)  # fmt: skip
"""Rates of common adapters: those of POSIX, of Linux's termios.h, and of an FT2232H."""


def baud_error(clock_hz: int, baud: int) -> float:
    """Signed relative error of the rate of the nearest integer divider."""
    return clock_hz / Geometry(clock_hz=clock_hz, baud=baud).bit_clocks / baud - 1.0


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


def _good(clock_hz: int, baud: int) -> bool:
    return clock_hz >= _FEWEST_CLOCKS * baud and abs(baud_error(clock_hz, baud)) <= TOLERANCE


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


def constraints(target: Target, ethernet: Ethernet | None = None) -> tuple[str, str]:
    """Name and text of a target's constraint file.

    The serial line and the LED are asynchronous to the clock. `serial_rx` has a pull-up, so that an
    unconnected line is idle.

    Args:
        target: the board.
        ethernet: its PHY, None for a serial line.
    """
    ports = pins(target) if ethernet is None else ethernet_pins(target, ethernet)
    if target.device.family == "ecp5":
        return "viform.lpf", _lpf(target, ports, ethernet)
    return "viform.xdc", _xdc(target, ports, ethernet)


def _lpf(target: Target, ports: dict[str, str], ethernet: Ethernet | None) -> str:
    lines = [f"# {target.board}, {target.part}"]
    for port, pin in ports.items():
        pull = " PULLMODE=UP" if port == "serial_rx" else ""
        lines.append(f'LOCATE COMP "{port}" SITE "{pin}";')
        lines.append(f'IOBUF PORT "{port}" IO_TYPE={target.io_standard}{pull};')
    lines.append(f'FREQUENCY PORT "clk_in" {target.pin_hz / 1e6:g} MHZ;')
    if ethernet is not None:
        name, hz = ethernet.rx_clock
        lines.append(f'FREQUENCY PORT "{ethernet.kind}_{name}" {hz / 1e6:g} MHZ;')
    return "\n".join(lines) + "\n"


def _xdc(target: Target, ports: dict[str, str], ethernet: Ethernet | None) -> str:
    lines = [f"# {target.board}, {target.part}"]
    for port, pin in ports.items():
        pull = " PULLTYPE PULLUP" if port == "serial_rx" else ""
        name = f"{{{port}}}" if "[" in port else port
        lines.append(
            f"set_property -dict {{ PACKAGE_PIN {pin} IOSTANDARD {target.io_standard}{pull} }} "
            f"[get_ports {name}]"
        )
    lines.append(f"create_clock -name clk_in -period {1e9 / target.pin_hz:.3f} [get_ports clk_in]")
    if target.divide != 1:
        lines.append(
            f"create_generated_clock -name clk -source [get_ports clk_in] "
            f"-divide_by {target.divide} [get_pins half_reg/Q]"
        )
    if ethernet is None:
        lines += [
            "set_false_path -from [get_ports serial_rx]",
            "set_false_path -to [get_ports {serial_tx led}]",
        ]
    else:
        lines.append("set_false_path -to [get_ports {led eth_ref_clk}]")
        for name in ("clocks_rx", "clocks_tx"):
            port = f"{ethernet.kind}_{name}"
            period = 1e9 / ethernet.rx_clock[1]
            lines.append(f"create_clock -name {name} -period {period:.3f} [get_ports {port}]")
        lines.append("set_clock_groups -asynchronous -group clk -group clocks_rx -group clocks_tx")
    lines += [
        "set_property CFGBVS VCCO [current_design]",
        "set_property CONFIG_VOLTAGE 3.3 [current_design]",
    ]
    return "\n".join(lines) + "\n"


class Design(NamedTuple):
    """A build for a target.

    Attributes:
        target: the board.
        geometry: geometry with the target's clock, and memories that fit its device.
        build: value of `ctrl_build`.
        ethernet: PHY that replaces the serial line, None for the line.
        network: addresses of the board on it.
    """

    target: Target
    geometry: Geometry
    build: int
    ethernet: Ethernet | None = None
    network: Network | None = None

    @property
    def baud_error(self) -> float:
        """Signed relative error of the serial line's baud."""
        return baud_error(self.geometry.clock_hz, self.geometry.baud)

    def files(self) -> dict[str, str]:
        """Names and texts of all files, the Makefile last. An incomplete folder lacks it."""
        texts = {path.name: path.read_text(encoding="utf-8") for path in verilog_files(VERILOG)}
        ethernet, net = self.ethernet, self.network
        name, text = constraints(self.target, ethernet)
        if ethernet is None or net is None:
            texts[f"{TOP}.v"] = top_module(self.target, self.geometry, self.build)
            rules = recipe(self.target, sorted(texts), name)
        else:
            texts[f"{TOP}.v"] = ethernet_top(self.target, ethernet, self.geometry, self.build)
            rules = recipe(self.target, sorted(texts), name, core=f"{CORE}.v")
            texts["liteeth.yml"] = core_config(ethernet, self.target.part, net)
        texts |= {name: text, "csr.csv": csr_csv(self.geometry)}
        texts["README.md"] = readme(self.target, self.geometry, self.build, ethernet, net)
        return texts | rules


def design_for(
    target: Target,
    *,
    rows: int = 32,
    columns: int = 32,
    lanes: int = 32,
    baud: int = 115_200,
    ethernet: Ethernet | None = None,
    network: Network | None = None,
) -> Design:
    """The build of a geometry for a target, with a serial line or, if given, Ethernet.

    Raises InputError for a baud that the target's clock does not allow, and for a geometry whose
    memories exceed its block RAMs.
    """
    clock_hz = target.clock_hz if ethernet is None else ethernet.clock_hz
    check_baud(clock_hz, baud)
    geometry = fitted(Geometry(rows, columns, lanes, clock_hz, baud), target)
    return Design(target, geometry, build_crc(geometry), ethernet, network)


def check_folder(folder: Path) -> None:
    """Raises InputError unless `folder` is empty, or a new name in an existing folder."""
    try:
        if folder.is_dir():
            if any(folder.iterdir()):
                raise InputError(
                    f"{folder}", "a new or an empty folder", "one with contents",
                    "choose another name, or empty it",
                )  # fmt: skip
        elif folder.exists() or folder.is_symlink():
            raise InputError(f"{folder}", "a folder", "a file", "choose another name")
        elif not folder.parent.is_dir():
            raise InputError(
                f"{folder}", "in a folder that exists", f"in {folder.parent}",
                f"mkdir -p {folder.parent}",
            )  # fmt: skip
    except OSError as exc:
        raise refusal(folder, exc) from exc


def write_folder(design: Design, folder: Path) -> list[str]:
    """Writes the files of a design; returns their sorted names.

    The files are written to a temporary folder and then moved, the Makefile last. After a failure,
    a new folder does not exist and an existing one is empty. Raises InputError as `check_folder`,
    and if the system refuses the write.
    """
    check_folder(folder)
    texts = design.files()
    new = not folder.exists()
    part = folder / f".{os.getpid()}.part"  # on the same file system
    try:
        part.mkdir(parents=True)
        try:
            for name, text in texts.items():
                (part / name).write_text(text, encoding="utf-8")
            for name in texts:
                os.replace(part / name, folder / name)
            part.rmdir()
        except BaseException:
            for name in reversed(texts):
                (folder / name).unlink(missing_ok=True)
            shutil.rmtree(part, ignore_errors=True)
            if new:
                folder.rmdir()
            raise
    except OSError as exc:
        raise refusal(folder, exc) from exc
    return sorted(texts)
