"""Text of the folder's README.md: how to build, load and bring up the design."""

from __future__ import annotations

from rtl_model.gateware.ethernet import Ethernet, Network
from rtl_model.gateware.ethernet_top import ethernet_pins
from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import pins
from rtl_model.geometry import Geometry


def readme(
    target: Target,
    geometry: Geometry,
    build: int,
    ethernet: Ethernet | None = None,
    network: Network | None = None,
) -> str:
    """The text of README.md.

    Args:
        target: the board.
        geometry: geometry of the build.
        build: value of `ctrl_build`.
        ethernet: PHY that replaces the serial line, None for the line.
        network: addresses of the board on it.
    """
    if target.device.family == "ecp5":
        tools = "yosys, nextpnr-ecp5 and ecppack (Project Trellis)"
        variables = "`make YOSYS=... NEXTPNR=... ECPPACK=...` names tools in other folders."
    else:
        tools = "Vivado (the free edition supports this device)"
        variables = "`make VIVADO=...` names a Vivado in another folder."
    if target.dfu:
        load = (
            "    make program    # dfu-util; hold the button while plugging in, and the bootloader "
            "waits"
        )
    else:
        load = (
            "    make program    # openFPGALoader, into the FPGA, until power is removed\n"
            "    make flash      # into the flash, for every power-on"
        )
    line, port, waits = (
        f"The serial line is on {target.serial}.", f"/dev/ttyUSB0 --baud {geometry.baud}",
        "If it\nblinks fast all the time, `serial_rx` is low.",
    )  # fmt: skip
    rate, heard = f"{geometry.baud} baud, ", "bytes arrive"
    levels = {"serial_rx": ", to the FPGA", "serial_tx": ", from the FPGA"}
    if ethernet is None or network is None:
        sites = pins(target)
    else:
        sites = ethernet_pins(target, ethernet)
        tools += ", and liteeth_gen (`pip install litex==2024.12 liteeth==2024.12`) for the core"
        line = f"Ethernet is on {ethernet.connector}. The board answers ping at {network.ip}."
        port, rate, waits, heard = f"udp:{network.ip}", "", "", "requests arrive"
    rows = "\n".join(
        f"| `{name}`{levels.get(name, '')} | {pin} |"
        for name, pin in sites.items() if name not in ("clk_in", "led")
    )  # fmt: skip
    return f"""\
# {geometry.rows} x {geometry.columns} pixels on a {target.board}

{target.part}, {geometry.clock_hz / 1e6:g} MHz, {geometry.lanes} lanes, {rate}build
{build:08x}.

## Build

    make

needs {tools}. {variables} The result is
`viform.bit`, or an error if the timing is not met.

## Load

{load}

## Bring up

{line}

    viform board identify --port {port}
    viform board bringup --port {port} --out bringup

`identify` must print build {build:08x}. `csr.csv` is the register map for LiteX's host tools.

The LED blinks once in one to two seconds while the clock runs, and fast while {heard}. {waits}

| port | pin |
|---|---|
| `clk_in` ({target.pin_hz / 1e6:g} MHz) | {sites["clk_in"]} |
{rows}
| `led`, lit by a {"low" if target.led_low else "high"} level | {sites["led"]} |
"""
