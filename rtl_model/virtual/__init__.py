"""The virtual test board: the Verilog, or the cycle model, behind a pty, with faults on demand."""

from rtl_model.virtual.board import LEVELS, LINGER_S, VirtualBoard, nominal_clock
from rtl_model.virtual.faults import Faults, parse
from rtl_model.virtual.line import CUT_S, POWER_UP_S
from rtl_model.virtual.simulators import Level

__all__ = [
    "CUT_S",
    "LEVELS",
    "LINGER_S",
    "POWER_UP_S",
    "Faults",
    "Level",
    "VirtualBoard",
    "nominal_clock",
    "parse",
]
