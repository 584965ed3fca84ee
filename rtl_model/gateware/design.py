"""One build for one target: its geometry, its BUILD, and the files of its folder."""

from __future__ import annotations

from typing import NamedTuple

from rtl_model.gateware.baud import baud_error, check_baud
from rtl_model.gateware.block_ram import fitted
from rtl_model.gateware.constraints import constraints
from rtl_model.gateware.ethernet import Ethernet, Network, core_config
from rtl_model.gateware.ethernet_top import CORE, ethernet_top
from rtl_model.gateware.readme import readme
from rtl_model.gateware.recipe import recipe
from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import TOP, top_module
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
