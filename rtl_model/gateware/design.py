"""One build for one target: its geometry, its BUILD, the files of its folder, which is written
atomically, and its cells, counted by yosys, beside those of the device.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import NamedTuple

from cosim import InputError
from cosim.files.atomic import refusal
from rtl_model.gateware.ethernet import Ethernet, Network, core_config
from rtl_model.gateware.recipe import readme, recipe
from rtl_model.gateware.targets import Target, baud_error, check_baud, fitted
from rtl_model.gateware.top import CORE, TOP, constraints, ethernet_top, top_module
from rtl_model.geometry import Geometry
from rtl_model.registers import csr_csv
from rtl_model.synthesis import synthesise
from rtl_model.verilated import VERILOG, build_crc, verilog_files


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


class Fit(NamedTuple):
    """Cells of a build, and those of the device (`*_of`).

    Placement is not computed, so a build near 100 % may still fail.

    Attributes:
        luts: look-up tables. In an ECP5 each cell of a carry chain counts as two.
        flip_flops: flip-flops.
        block_rams: block RAMs of 18 kbit; one of 36 kbit counts as two.
    """

    luts: int
    luts_of: int
    flip_flops: int
    flip_flops_of: int
    block_rams: int
    block_rams_of: int

    @property
    def ok(self) -> bool:
        """Whether the device has enough cells of each kind."""
        return (
            self.luts <= self.luts_of
            and self.flip_flops <= self.flip_flops_of
            and self.block_rams <= self.block_rams_of
        )


def fit(design: Design) -> Fit:
    """Synthesises the top module of a design with yosys. Raises InputError if yosys is missing."""
    device = design.target.device
    with tempfile.TemporaryDirectory() as folder:
        for name, text in design.files().items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        cells = synthesise(device.family, top=TOP, settings={}, sources=Path(folder))
    ecp5 = device.family == "ecp5"
    return Fit(
        luts=cells.luts + (2 * cells.carries if ecp5 else 0),
        luts_of=device.luts,
        flip_flops=cells.flip_flops,
        flip_flops_of=device.flip_flops,
        block_rams=cells.block_rams + cells.large_block_rams,
        block_rams_of=device.block_rams,
    )
