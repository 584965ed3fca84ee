"""Etherbone over UDP from the host's side: packets, the socket, and numbered, repeated requests."""

from rtl_model.host.ether.diagnosis import count_losses, most_words
from rtl_model.host.ether.etherbone import WRITE_OVERHEAD, Etherbone
from rtl_model.host.ether.exchange import PacketPort
from rtl_model.host.ether.packet import (
    Malformed,
    Words,
    answer_packet,
    parse,
    probe_reply,
    record_packet,
)
from rtl_model.host.ether.udp import (
    UdpAddress,
    is_loopback,
    is_udp,
    open_udp,
    resolved,
    udp_address,
)

__all__ = [
    "WRITE_OVERHEAD",
    "Etherbone",
    "Malformed",
    "PacketPort",
    "UdpAddress",
    "Words",
    "answer_packet",
    "count_losses",
    "is_loopback",
    "is_udp",
    "most_words",
    "open_udp",
    "parse",
    "probe_reply",
    "record_packet",
    "resolved",
    "udp_address",
]
