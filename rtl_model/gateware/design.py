"""One build for one target: its geometry, its BUILD, and the files of its folder, which is written
atomically.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import NamedTuple

from cosim import InputError
from cosim.files.atomic import refusal
from rtl_model.gateware.ethernet import Ethernet, Network, core_config
from rtl_model.gateware.fitting import (
    baud_error,
    check_baud,
    fitted,
)
from rtl_model.gateware.recipe import readme, recipe
from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import (
    CORE,
    TOP,
    constraints,
    ethernet_top,
    top_module,
)
from rtl_model.geometry import Geometry
from rtl_model.registers import csr_csv
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
