"""What common links carry of a pixel array's spikes."""

from __future__ import annotations

from typing import NamedTuple

# UDP over IPv4: headers of 8 and 20 bytes in a frame of 1500 (RFC 768, RFC 791). Ethernet: 14 bytes
# of header, 4 of check sequence, 8 of preamble and a gap of 12 (IEEE 802.3, clauses 3 and 4).
_UDP = (8 * (1500 - 28), 8 * (28 + 14 + 4 + 8 + 12))
_UDP_SOURCE = "IEEE 802.3; UDP over IPv4 (RFC 768, RFC 791) in frames of 1500 bytes"
# A memory write of 256 bytes has six words of 32 bits around it: framing, sequence number, LCRC,
# and a header of four (Intel AN 829, "Understanding PCI Express Throughput").
_PCIE = (8 * 256, 32 * 6)
_PCIE_SOURCE = "PCI Express Base 2.0, 3.0; Intel AN 829; writes of 256 bytes"


class Link(NamedTuple):
    """A link from an FPGA board to a host.

    Attributes:
        name: name of the link.
        line_rate: bits a second as the standard counts them, after line coding.
        payload, overhead: bits of a packet that are free for spikes, and bits around them.
        source: source of both.
    """

    name: str
    line_rate: float
    payload: int
    overhead: int
    source: str

    @property
    def rate(self) -> float:
        """Most bits of payload a second. No link exceeds it; hosts and drivers often reach less."""
        return self.line_rate * self.payload / (self.payload + self.overhead)


LINKS: tuple[Link, ...] = (
    Link("UART, 115 200 baud", 115_200, 8, 2, "8N1"),
    Link("UART, 12 Mbaud", 12e6, 8, 2, "8N1; FTDI FT2232H data sheet"),
    Link("Ethernet, 100 Mbit/s", 100e6, *_UDP, _UDP_SOURCE),
    Link("Ethernet, 1 Gbit/s", 1e9, *_UDP, _UDP_SOURCE),
    Link("USB 3.0, FT601", 32 * 100e6, 1, 0, "FTDI DS_FT600Q-FT601Q: burst rate of 400 MB/s"),
    Link("Ethernet, 10 Gbit/s", 10e9, *_UDP, _UDP_SOURCE),
    Link("PCIe 2.0 x4", 4 * 5e9 * 8 / 10, *_PCIE, _PCIE_SOURCE),
    Link("PCIe 3.0 x4", 4 * 8e9 * 128 / 130, *_PCIE, _PCIE_SOURCE),
    Link("PCIe 3.0 x8", 8 * 8e9 * 128 / 130, *_PCIE, _PCIE_SOURCE),
)
"""Links from the slowest to the fastest."""


def raw_rate(rows: int, columns: int, clock_hz: float) -> float:
    """Bits a second of one bit a pixel and cycle."""
    return rows * columns * clock_hz
