"""The Verilog on a real FPGA: targets, and a folder for each that builds a bitstream."""

from rtl_model.gateware.baud import TOLERANCE, baud_error, check_baud
from rtl_model.gateware.block_ram import block_rams
from rtl_model.gateware.design import Design, design_for
from rtl_model.gateware.fit import Fit, fit
from rtl_model.gateware.folder import check_folder, write_folder
from rtl_model.gateware.targets import TARGETS, target_named
from rtl_model.gateware.top import PORTS, TOP, pins

__all__ = [
    "PORTS",
    "TARGETS",
    "TOLERANCE",
    "TOP",
    "Design",
    "Fit",
    "baud_error",
    "block_rams",
    "check_baud",
    "check_folder",
    "design_for",
    "fit",
    "pins",
    "target_named",
    "write_folder",
]
