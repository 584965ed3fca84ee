"""Lockstep comparison of Verilog and cycle model under random programs."""

from rtl_model.lockstep.compare import run
from rtl_model.lockstep.program import Program

__all__ = [
    "Program",
    "run",
]
