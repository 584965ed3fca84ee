"""The Verilog on a real FPGA: targets, and a folder for each that builds a bitstream."""

from rtl_model.gateware.baud import TOLERANCE, baud_error, check_baud
from rtl_model.gateware.block_ram import block_rams, fitted
from rtl_model.gateware.constraints import constraints
from rtl_model.gateware.design import Design, design_for
from rtl_model.gateware.fit import Fit, fit
from rtl_model.gateware.folder import check_folder, write_folder
from rtl_model.gateware.readme import readme
from rtl_model.gateware.recipe import recipe
from rtl_model.gateware.targets import TARGETS, Device, GatewareFamily, Target, target_named
from rtl_model.gateware.top import PORTS, TOP, pins, top_module

__all__ = [
    "PORTS",
    "TARGETS",
    "TOLERANCE",
    "TOP",
    "Design",
    "Device",
    "Fit",
    "GatewareFamily",
    "Target",
    "baud_error",
    "block_rams",
    "check_baud",
    "check_folder",
    "constraints",
    "design_for",
    "fit",
    "fitted",
    "pins",
    "readme",
    "recipe",
    "target_named",
    "top_module",
    "write_folder",
]
