"""The Verilog as it is written, compiled by Verilator to shared libraries that Python steps."""

from rtl_model.verilated.build import (
    KEPT_BYTES,
    KEPT_DAYS,
    PACKAGES,
    VERILOG,
    BuildFailed,
    build_crc,
    fst_library,
    library,
    missing,
    prune,
    verilog_files,
)
from rtl_model.verilated.system import VerilatedSystem, Waves, trace_format

__all__ = [
    "KEPT_BYTES",
    "KEPT_DAYS",
    "PACKAGES",
    "VERILOG",
    "BuildFailed",
    "VerilatedSystem",
    "Waves",
    "build_crc",
    "fst_library",
    "library",
    "missing",
    "prune",
    "trace_format",
    "verilog_files",
]
