"""Writes Verilog and csr.csv of a small design with LiteX's own, unmodified UARTBone.

Run by a Python that has LiteX: `python make_soc.py FOLDER CLOCK_HZ BAUD`. Behind the bone stand the
SoC controller with its scratch register, the identifier, a register of two words and 4 KiB of RAM.
"""

import os
import sys

from litex.build.generic_platform import GenericPlatform, Pins, Subsignal
from litex.soc.integration.builder import Builder
from litex.soc.integration.soc_core import SoCMini
from litex.soc.interconnect.csr import AutoCSR, CSRStatus, CSRStorage
from migen import ClockDomain, Module

PINS = [
    ("clk", 0, Pins(1)),
    ("rst", 0, Pins(1)),
    ("serial", 0, Subsignal("tx", Pins(1)), Subsignal("rx", Pins(1))),
]


class Platform(GenericPlatform):
    """No vendor: Verilog alone."""

    def build(self, fragment, build_dir, build_name, **_):
        os.makedirs(build_dir, exist_ok=True)
        os.chdir(build_dir)
        self.get_verilog(fragment, name=build_name).write(f"{build_name}.v")


class Clock(Module):
    """Clock and reset from pins."""

    def __init__(self, clk, rst):
        self.clock_domains.cd_sys = ClockDomain()
        self.comb += [self.cd_sys.clk.eq(clk), self.cd_sys.rst.eq(rst)]


class Wide(Module, AutoCSR):
    """Registers of two words."""

    def __init__(self):
        self.value = CSRStorage(64, reset=0x0123456789ABCDEF)
        self.copy = CSRStatus(64)
        self.comb += self.copy.status.eq(self.value.storage)


class Design(SoCMini):
    """The design."""

    def __init__(self, clock_hz, baud):
        platform = Platform(device="", io=PINS)
        platform.name = "soc"
        self.submodules.crg = Clock(platform.request("clk"), platform.request("rst"))
        SoCMini.__init__(
            self,
            platform,
            clk_freq=clock_hz,
            ident="LiteX behind its own UARTBone",
            ident_version=False,
        )
        self.add_uartbone(uart_name="serial", baudrate=baud)
        self.add_ram("ram", origin=0x1000_0000, size=0x1000)
        self.submodules.wide = Wide()


def main():
    folder, clock_hz, baud = os.path.abspath(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    builder = Builder(
        Design(clock_hz, baud),
        output_dir=folder,
        gateware_dir=folder,
        compile_software=False,
        compile_gateware=True,
        csr_csv=os.path.join(folder, "csr.csv"),
    )
    builder.build(build_name="soc", run=True)


if __name__ == "__main__":
    main()
