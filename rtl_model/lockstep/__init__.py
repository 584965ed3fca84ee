"""Verilog and cycle model in lockstep under random programs."""

from rtl_model.lockstep.compare import Outcome, run
from rtl_model.lockstep.coverage import Coverage
from rtl_model.lockstep.difference import Difference
from rtl_model.lockstep.program import ADDRESS, Chunk, Program, Write

__all__ = [
    "ADDRESS",
    "Chunk",
    "Coverage",
    "Difference",
    "Outcome",
    "Program",
    "Write",
    "run",
]
