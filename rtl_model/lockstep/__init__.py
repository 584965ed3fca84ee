"""Verilog and cycle model in lockstep: under random programs, and under random packets."""

from rtl_model.lockstep.compare import Outcome, run
from rtl_model.lockstep.coverage import Coverage
from rtl_model.lockstep.difference import Difference
from rtl_model.lockstep.packets import FUZZED, Fuzz, fuzz
from rtl_model.lockstep.program import ADDRESS, Chunk, Program, Write

__all__ = [
    "ADDRESS",
    "FUZZED",
    "Chunk",
    "Coverage",
    "Difference",
    "Fuzz",
    "Outcome",
    "Program",
    "Write",
    "fuzz",
    "run",
]
