"""The unmodified Verilog, compiled by Verilator to shared libraries that Python steps."""

from rtl_model.verilated.build import (
    VERILOG,
    BuildFailed,
    build_crc,
    fst_library,
    library,
    verilog_files,
)
from rtl_model.verilated.system import VerilatedSystem, Waves, trace_format

__all__ = [
    "VERILOG",
    "BuildFailed",
    "VerilatedSystem",
    "Waves",
    "build_crc",
    "fst_library",
    "library",
    "trace_format",
    "verilog_files",
]
