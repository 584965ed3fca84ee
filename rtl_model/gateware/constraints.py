"""Constraint files, with pins and clocks: Lattice's .lpf and Xilinx's .xdc."""

from __future__ import annotations

from rtl_model.gateware.ethernet import Ethernet
from rtl_model.gateware.ethernet_top import ethernet_pins
from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import pins


def constraints(target: Target, ethernet: Ethernet | None = None) -> tuple[str, str]:
    """Name and text of a target's constraint file.

    The serial line and the LED are asynchronous to the clock. `serial_rx` has a pull-up, so that an
    unconnected line is idle.

    Args:
        target: the board.
        ethernet: its PHY, None for a serial line.
    """
    ports = pins(target) if ethernet is None else ethernet_pins(target, ethernet)
    if target.device.family == "ecp5":
        return "viform.lpf", _lpf(target, ports, ethernet)
    return "viform.xdc", _xdc(target, ports, ethernet)


def _lpf(target: Target, ports: dict[str, str], ethernet: Ethernet | None) -> str:
    lines = [f"# {target.board}, {target.part}"]
    for port, pin in ports.items():
        pull = " PULLMODE=UP" if port == "serial_rx" else ""
        lines.append(f'LOCATE COMP "{port}" SITE "{pin}";')
        lines.append(f'IOBUF PORT "{port}" IO_TYPE={target.io_standard}{pull};')
    lines.append(f'FREQUENCY PORT "clk_in" {target.pin_hz / 1e6:g} MHZ;')
    if ethernet is not None:
        name, hz = ethernet.rx_clock
        lines.append(f'FREQUENCY PORT "{ethernet.kind}_{name}" {hz / 1e6:g} MHZ;')
    return "\n".join(lines) + "\n"


def _xdc(target: Target, ports: dict[str, str], ethernet: Ethernet | None) -> str:
    lines = [f"# {target.board}, {target.part}"]
    for port, pin in ports.items():
        pull = " PULLTYPE PULLUP" if port == "serial_rx" else ""
        name = f"{{{port}}}" if "[" in port else port
        lines.append(
            f"set_property -dict {{ PACKAGE_PIN {pin} IOSTANDARD {target.io_standard}{pull} }} "
            f"[get_ports {name}]"
        )
    lines.append(f"create_clock -name clk_in -period {1e9 / target.pin_hz:.3f} [get_ports clk_in]")
    if target.divide != 1:
        lines.append(
            f"create_generated_clock -name clk -source [get_ports clk_in] "
            f"-divide_by {target.divide} [get_pins half_reg/Q]"
        )
    if ethernet is None:
        lines += [
            "set_false_path -from [get_ports serial_rx]",
            "set_false_path -to [get_ports {serial_tx led}]",
        ]
    else:
        lines.append("set_false_path -to [get_ports {led eth_ref_clk}]")
        for name in ("clocks_rx", "clocks_tx"):
            port = f"{ethernet.kind}_{name}"
            period = 1e9 / ethernet.rx_clock[1]
            lines.append(f"create_clock -name {name} -period {period:.3f} [get_ports {port}]")
        lines.append("set_clock_groups -asynchronous -group clk -group clocks_rx -group clocks_tx")
    lines += [
        "set_property CFGBVS VCCO [current_design]",
        "set_property CONFIG_VOLTAGE 3.3 [current_design]",
    ]
    return "\n".join(lines) + "\n"
