"""Conventional imagers as whole machines: pixel, sequencer cycle by cycle, registers, trace."""

from rtl_model.imagers.bus import ImagerBus, Machine, line_of
from rtl_model.imagers.catalogue import IMAGERS, design, machine
from rtl_model.imagers.imager import Imager
from rtl_model.imagers.register_file import RegisterFile
from rtl_model.imagers.registers import HEAD, IMAGER_MAGIC, Design, Taking
from rtl_model.imagers.trace import Record, Signal, trace_ending, write_trace

__all__ = [
    "HEAD",
    "IMAGERS",
    "IMAGER_MAGIC",
    "Design",
    "Imager",
    "ImagerBus",
    "Machine",
    "Record",
    "RegisterFile",
    "Signal",
    "Taking",
    "design",
    "line_of",
    "machine",
    "trace_ending",
    "write_trace",
]
