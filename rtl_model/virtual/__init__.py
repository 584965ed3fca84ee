"""The virtual test board: the Verilog or the cycle model behind a pty, with injected faults."""

from rtl_model.virtual.board import LEVELS, VirtualBoard, nominal_clock
from rtl_model.virtual.simulators import Level

__all__ = [
    "LEVELS",
    "Level",
    "VirtualBoard",
    "nominal_clock",
]
