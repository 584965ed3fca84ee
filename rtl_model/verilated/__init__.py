"""The unmodified Verilog, compiled by Verilator to shared libraries that Python steps."""

from rtl_model.verilated.build import (
    VERILOG,
    BuildFailed,
    build_crc,
    fst_library,
    library,
    verilog_files,
)
from rtl_model.verilated.system import VerilatedModule, VerilatedSystem, Waves, trace_format
from rtl_model.verilated.waves import VerilatedPins, board_signals, system_signals, write_view

__all__ = [
    "VERILOG",
    "BuildFailed",
    "VerilatedModule",
    "VerilatedPins",
    "VerilatedSystem",
    "Waves",
    "board_signals",
    "build_crc",
    "fst_library",
    "library",
    "system_signals",
    "trace_format",
    "verilog_files",
    "write_view",
]
