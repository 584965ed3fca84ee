"""Ethernet of the target boards, and the configuration of LiteEth's core for each.

The core is not part of the folder: `make` lets LiteEth (liteeth_gen, of the Python package
`liteeth`) write it from `liteeth.yml`. It answers ARP, ping and Etherbone.

Sources:
- Pins and PHYs: litex-boards, litex_boards/platforms/colorlight_i5.py (revision 7.0: two B50612D)
  and digilent_arty.py (DP83848J, which needs 25 MHz from the FPGA).
- ULX3S: emard/ulx3s, doc/constraints/ulx3s_v20.lpf; a LAN8720 module of Waveshare (50 MHz on the
  module) on J1, with TXD1 at GN9 and MDC at GP13.
- Options and ports of the core: LiteEth 2024.12, liteeth/gen.py.
- Divider of the PLL: Lattice FPGA-TN-02200, EHXPLLL; its oscillator runs at 400 to 800 MHz.
"""

from __future__ import annotations

import ipaddress
import re
from typing import Literal, NamedTuple

from cosim import InputError

BUFFER_WORDS = 256
"""Longest Etherbone record that the core takes: 255 words and their address."""


class Ethernet(NamedTuple):
    """A PHY on a board.

    Attributes:
        name: name on the command line.
        connector: connector of the cable.
        kind: interface of the PHY.
        phy: LiteEth's class for it.
        pins: pins of each port of the core, without the prefix of the interface, bit 0 first.
        clock_hz: clock of the design, Hz; a PLL makes it if the target's clock is another. Behind
            gigabit Ethernet it exceeds 31.25 MHz, for LiteEth moves 32 bits a clock, the line 125
            Mbyte/s.
        rx_clock: port with the PHY's clock for received data, and its frequency, Hz.
        reference: pin at which the PHY expects 25 MHz, else empty.
    """

    name: str
    connector: str
    kind: Literal["rmii", "rgmii", "mii"]
    phy: str
    pins: dict[str, str]
    clock_hz: int
    rx_clock: tuple[str, int]
    reference: str = ""

    @property
    def ports(self) -> dict[str, str]:
        """The pin of each port of the top module, with an index for ports of several bits."""
        found = {}
        for name, sites in self.pins.items():
            every = sites.split()
            for n, site in enumerate(every):
                index = f"[{n}]" if len(every) > 1 else ""
                found[f"{self.kind}_{name}{index}"] = site
        if self.reference:
            found["eth_ref_clk"] = self.reference
        return found


class Network(NamedTuple):
    """Addresses of a board.

    Attributes:
        ip: IPv4 address.
        mac: Ethernet address, 48 bits.
    """

    ip: str
    mac: int


def _colorlight(
    name: str, connector: str, clocks: tuple[str, str], data: dict[str, str]
) -> Ethernet:
    tx, rx = clocks
    pins = {"clocks_tx": tx, "clocks_rx": rx, "rst_n": "P4", "mdio": "P5", "mdc": "N5", **data}
    return Ethernet(
        name, connector, "rgmii", "LiteEthECP5PHYRGMII", pins, 37_500_000,
        ("clocks_rx", 125_000_000),
    )  # fmt: skip


_ULX3S = Ethernet(
    "rmii", "a LAN8720 module on J1, GN9/GP9 to GN13/GP13", "rmii", "LiteEthPHYRMII",
    {
        "clocks_ref_clk": "F3", "rst_n": "A2", "rx_data": "E3 F4", "crs_dv": "G3", "tx_en": "B4",
        "tx_data": "C4 B1", "mdc": "H4", "mdio": "G5",
    },
    25_000_000, ("clocks_ref_clk", 50_000_000),
)  # fmt: skip

_ARTY = Ethernet(
    "mii", "the RJ45 jack J9", "mii", "LiteEthPHYMII",
    {
        "clocks_tx": "H16", "clocks_rx": "F15", "rst_n": "C16", "mdio": "K13", "mdc": "F16",
        "rx_dv": "G16", "rx_er": "C17", "rx_data": "D18 E17 E18 G17", "tx_en": "H15",
        "tx_data": "H14 J14 J13 H17", "col": "D17", "crs": "G14",
    },
    50_000_000, ("clocks_rx", 25_000_000), reference="G18",
)  # fmt: skip

ETHERNET: dict[str, tuple[Ethernet, ...]] = {
    **{f"ulx3s-{size}": (_ULX3S,) for size in ("12f", "25f", "45f", "85f")},
    "colorlight-i5": (
        _colorlight("phy0", "PHY 0 of litex-boards", ("G1", "H2"), {
            "rx_ctl": "P2", "rx_data": "K2 L1 N1 P1", "tx_ctl": "K1", "tx_data": "G2 H1 J1 J3",
        }),
        _colorlight("phy1", "PHY 1 of litex-boards", ("U19", "L19"), {
            "rx_ctl": "M20", "rx_data": "P20 N19 N20 M19", "tx_ctl": "P19",
            "tx_data": "U20 T19 T20 R20",
        }),
    ),
    "arty-a7-35": (_ARTY,),
    "arty-a7-100": (_ARTY,),
}  # fmt: skip
"""PHYs of each target that has some."""


def ethernet_named(target: str, name: str) -> Ethernet:
    """The PHY of a target by name. Raises InputError for another."""
    every = ETHERNET.get(target, ())
    found = next((one for one in every if one.name == name), None)
    if found is None:
        known = ", ".join(one.name for one in every)
        raise InputError(
            f"--ethernet of {target}", f"one of {known}" if every else "left out", repr(name[:40]),
            "choose one" if every else f"targets with Ethernet are {', '.join(ETHERNET)}",
        )  # fmt: skip
    return found


def network(ip: str, mac: str) -> Network:
    """Addresses from their texts. Raises InputError unless they are those of one host."""
    try:
        address = ipaddress.IPv4Address(ip)
    except ValueError:
        address = None
    if address is None or address.is_multicast or address.is_unspecified or address.is_loopback:
        raise InputError("--ip", "an IPv4 address of a host", repr(ip[:40]), "give one")
    text = mac.replace("-", ":")
    good = re.fullmatch(r"(?:[0-9a-fA-F]{2}:){5}[0-9a-fA-F]{2}", text)
    number = int(text.replace(":", ""), 16) if good else 0
    if not number or number >> 40 & 1:
        raise InputError(
            "--mac", "six bytes of a single host, as 10:e2:d5:00:00:01", repr(mac[:40]), "give one"
        )
    return Network(str(address), number)


def core_config(ethernet: Ethernet, part: str, net: Network) -> str:
    """The text of liteeth.yml."""
    lattice = part.startswith("LFE5")
    delays = "phy_tx_delay: 0\nphy_rx_delay: 2e-9\n" if ethernet.kind == "rgmii" else ""
    return f"""\
phy: {ethernet.phy}
{delays}vendor: {"lattice" if lattice else "xilinx"}
toolchain: {"trellis" if lattice else "vivado"}
device: {part}
core: udp
clk_freq: {ethernet.clock_hz}
data_width: 32
mac_address: {net.mac:#014x}
ip_address: {net.ip}
etherbone: True
etherbone_port: 1234
etherbone_buffer_depth: {BUFFER_WORDS}
"""
