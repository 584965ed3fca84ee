"""Constraint files, with pins and clocks: Lattice's .lpf and Xilinx's .xdc."""

from __future__ import annotations

from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import pins

__all__ = ["constraints"]


def constraints(target: Target) -> tuple[str, str]:
    """Name and text of a target's constraint file.

    The serial line and the LED are asynchronous to the clock. `serial_rx` has a pull-up, so that an
    unconnected line is idle.
    """
    if target.device.family == "ecp5":
        return "viform.lpf", _lpf(target)
    return "viform.xdc", _xdc(target)


def _lpf(target: Target) -> str:
    lines = [f"# {target.board}, {target.part}"]
    for port, pin in pins(target).items():
        pull = " PULLMODE=UP" if port == "serial_rx" else ""
        lines.append(f'LOCATE COMP "{port}" SITE "{pin}";')
        lines.append(f'IOBUF PORT "{port}" IO_TYPE={target.io_standard}{pull};')
    lines.append(f'FREQUENCY PORT "clk_in" {target.pin_hz / 1e6:g} MHZ;')
    return "\n".join(lines) + "\n"


def _xdc(target: Target) -> str:
    lines = [f"# {target.board}, {target.part}"]
    for port, pin in pins(target).items():
        pull = " PULLTYPE PULLUP" if port == "serial_rx" else ""
        lines.append(
            f"set_property -dict {{ PACKAGE_PIN {pin} IOSTANDARD {target.io_standard}{pull} }} "
            f"[get_ports {port}]"
        )
    lines.append(f"create_clock -name clk_in -period {1e9 / target.pin_hz:.3f} [get_ports clk_in]")
    if target.divide != 1:
        lines.append(
            f"create_generated_clock -name clk -source [get_ports clk_in] "
            f"-divide_by {target.divide} [get_pins half_reg/Q]"
        )
    lines += [
        "set_false_path -from [get_ports serial_rx]",
        "set_false_path -to [get_ports {serial_tx led}]",
        "set_property CFGBVS VCCO [current_design]",
        "set_property CONFIG_VOLTAGE 3.3 [current_design]",
    ]
    return "\n".join(lines) + "\n"
