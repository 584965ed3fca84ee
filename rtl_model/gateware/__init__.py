"""The Verilog on a real FPGA: target boards, and the folder that builds a bitstream for each."""

from rtl_model.gateware.design import Design, design_for
from rtl_model.gateware.fit import Fit, fit
from rtl_model.gateware.folder import check_folder, write_folder
from rtl_model.gateware.targets import TARGETS, target_named

__all__ = [
    "TARGETS",
    "Design",
    "Fit",
    "check_folder",
    "design_for",
    "fit",
    "target_named",
    "write_folder",
]
