"""The Verilog on a real FPGA: target boards, and the folder that builds a bitstream for each."""

from rtl_model.gateware.design import Design, Fit, check_folder, design_for, fit, write_folder
from rtl_model.gateware.ethernet import ETHERNET, ethernet_named, network
from rtl_model.gateware.targets import TARGETS, target_named

__all__ = [
    "ETHERNET",
    "TARGETS",
    "Design",
    "Fit",
    "check_folder",
    "design_for",
    "ethernet_named",
    "fit",
    "network",
    "target_named",
    "write_folder",
]
