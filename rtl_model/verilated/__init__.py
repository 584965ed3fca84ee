"""The Verilog as it is written, compiled by Verilator to shared libraries that Python steps."""

from rtl_model.verilated.build import PACKAGES, VERILOG, build_crc, library, missing

__all__ = ["PACKAGES", "VERILOG", "build_crc", "library", "missing"]
