"""The virtual board over UDP: Etherbone packets in front of the cycle model or the Verilog."""

from rtl_model.virtual.ethernet.board import EthernetBoard

__all__ = ["EthernetBoard"]
