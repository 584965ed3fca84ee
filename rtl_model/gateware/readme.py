"""What stands in a folder's README.md: build, load, bring up."""

from __future__ import annotations

from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import pins
from rtl_model.geometry import Geometry

__all__ = ["readme"]


def readme(target: Target, geometry: Geometry, build: int) -> str:
    """Returns the text of a folder's README.md."""
    if target.device.family == "ecp5":
        tools = "yosys, nextpnr-ecp5 and ecppack (Project Trellis)"
        variables = "`make YOSYS=... NEXTPNR=... ECPPACK=...` names tools that stand elsewhere."
    else:
        tools = "Vivado (the free edition knows this device)"
        variables = "`make VIVADO=...` names a Vivado that stands elsewhere."
    if target.dfu:
        load = (
            "    make program    # dfu-util; hold the button while plugging in, and the bootloader "
            "waits"
        )
    else:
        load = (
            "    make program    # openFPGALoader, into the FPGA: gone when power goes\n"
            "    make flash      # into the flash: there at every power-on"
        )
    shown = pins(target)
    return f"""\
# {geometry.rows} x {geometry.columns} pixels on a {target.board}

{target.part}, {geometry.clock_hz / 1e6:g} MHz, {geometry.lanes} lanes, {geometry.baud} baud, build
{build:08x}.

## Build

    make

needs {tools}. {variables} It ends in
`viform.bit`, or with an error where the clock is not met.

## Load

{load}

## Bring up

The serial line is on {target.serial}.

    viform board identify --port /dev/ttyUSB0 --baud {geometry.baud}
    viform board bringup --port /dev/ttyUSB0 --baud {geometry.baud} --out bringup

`identify` must say build {build:08x}. `csr.csv` is the register map for other tools of LiteX.

The LED blinks once in one to two seconds while the clock runs, and fast while bytes come in. Fast
without end: `serial_rx` is held low.

| port | pin |
|---|---|
| `clk_in` ({target.pin_hz / 1e6:g} MHz) | {shown["clk_in"]} |
| `serial_rx`, to the FPGA | {shown["serial_rx"]} |
| `serial_tx`, from the FPGA | {shown["serial_tx"]} |
| `led`, lit by a {"low" if target.led_low else "high"} level | {shown["led"]} |
"""
