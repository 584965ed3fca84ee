"""Text of the folder's README.md: how to build, load and bring up the design."""

from __future__ import annotations

from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import pins
from rtl_model.geometry import Geometry

__all__ = ["readme"]


def readme(target: Target, geometry: Geometry, build: int) -> str:
    """The text of README.md; `build` is the value of `ctrl_build`."""
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
    pin = pins(target)
    return f"""\
# {geometry.rows} x {geometry.columns} pixels on a {target.board}

{target.part}, {geometry.clock_hz / 1e6:g} MHz, {geometry.lanes} lanes, {geometry.baud} baud, build
{build:08x}.

## Build

    make

needs {tools}. {variables} The result is
`viform.bit`, or an error if the timing is not met.

## Load

{load}

## Bring up

The serial line is on {target.serial}.

    viform board identify --port /dev/ttyUSB0 --baud {geometry.baud}
    viform board bringup --port /dev/ttyUSB0 --baud {geometry.baud} --out bringup

`identify` must print build {build:08x}. `csr.csv` is the register map for LiteX's host tools.

The LED blinks once in one to two seconds while the clock runs, and fast while bytes arrive. If it
blinks fast all the time, `serial_rx` is low.

| port | pin |
|---|---|
| `clk_in` ({target.pin_hz / 1e6:g} MHz) | {pin["clk_in"]} |
| `serial_rx`, to the FPGA | {pin["serial_rx"]} |
| `serial_tx`, from the FPGA | {pin["serial_tx"]} |
| `led`, lit by a {"low" if target.led_low else "high"} level | {pin["led"]} |
"""
