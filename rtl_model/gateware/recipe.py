"""What a folder says of its build: the Makefile, a Tcl script for Vivado, and README.md."""

from __future__ import annotations

from collections.abc import Sequence

from rtl_model.gateware.ethernet import Ethernet, Network
from rtl_model.gateware.targets import Target
from rtl_model.gateware.top import TOP, ethernet_pins, pins
from rtl_model.geometry import Geometry

_LITEETH = """\
LITEETH_GEN ?= liteeth_gen
{core}: liteeth.yml
\t$(LITEETH_GEN) --no-compile --output-dir liteeth liteeth.yml
\tcp liteeth/gateware/{core} $@

"""
_TOOLS = """\
YOSYS ?= yosys
NEXTPNR ?= nextpnr-ecp5
ECPPACK ?= ecppack
LOADER ?= openFPGALoader
DFU_SUFFIX ?= dfu-suffix
DFU_UTIL ?= dfu-util
"""


def recipe(
    target: Target, sources: Sequence[str], constraint: str, *, core: str = ""
) -> dict[str, str]:
    """Names and texts of the files that build and load a design.

    Args:
        target: the board.
        sources: names of the Verilog files and headers.
        constraint: name of the constraint file.
        core: Verilog file that LiteEth writes from liteeth.yml, empty for none.
    """
    sources = [*sources, core] if core else sources
    modules = [name for name in sources if name.endswith(".v")]
    liteeth = _LITEETH.format(core=core) if core else ""
    head = f"# {target.board}. `make` builds viform.bit, `make program` loads it.\n"
    tail = (
        f".DELETE_ON_ERROR:\n.PHONY: all clean {' '.join(_loads(target))}\n"
        f"VERILOG = {' '.join(sources)}\n\nall: viform.bit\n\n"
        f"{liteeth}"
    )
    if target.device.family == "ecp5":
        return {"Makefile": head + _TOOLS + tail + _ecp5(target, modules, constraint)}
    return {
        "build.tcl": _vivado(target, modules, constraint),
        "Makefile": head
        + "VIVADO ?= vivado\nLOADER ?= openFPGALoader\n"
        + tail
        + f"viform.bit: build.tcl $(VERILOG) {constraint}\n"
        "\t$(VIVADO) -mode batch -nojournal -log vivado.log -source build.tcl\n\n"
        + _load_rules(target)
        + "clean:\n\trm -rf viform.bit vivado.log timing.rpt utilization.rpt .Xil\n",
    }


def _ecp5(target: Target, modules: Sequence[str], constraint: str) -> str:
    device = target.device
    code = f" --idcode {device.idcode}" if device.idcode else ""
    # Mapped by delays (-abc9): fewer LUTs and shorter paths, see docs/fpga.md.
    # nextpnr fails if the timing is not met, so every viform.bit meets it.
    return (
        "viform.json: $(VERILOG)\n"
        f'\t$(YOSYS) -q -l yosys.log -p "read_verilog -I. {" ".join(modules)}; '
        f'synth_ecp5 -abc9 -top {TOP} -json $@"\n\n'
        f"viform.config: viform.json {constraint}\n"
        f"\t$(NEXTPNR) --{device.option} --package {target.package} --speed {target.speed} "
        f"--json viform.json --lpf {constraint} \\\n"
        "\t    --textcfg $@ --report nextpnr.json --log nextpnr.log --quiet\n\n"
        "viform.bit: viform.config\n"
        f"\t$(ECPPACK) --compress{code} viform.config $@\n\n"
        + _load_rules(target)
        + "clean:\n\trm -f viform.json viform.config viform.bit viform.dfu nextpnr.json "
        "nextpnr.log yosys.log\n"
    )


def _loads(target: Target) -> tuple[str, ...]:
    return ("program",) if target.dfu else ("program", "flash")


def _load_rules(target: Target) -> str:
    if target.dfu:
        vendor, product = target.dfu.split(":")
        return (
            "# Hold the button while plugging in to start the bootloader.\n"
            "program: viform.bit\n"
            "\tcp viform.bit viform.dfu\n"
            f"\t$(DFU_SUFFIX) -v {vendor} -p {product} -a viform.dfu\n"
            "\t$(DFU_UTIL) -D viform.dfu\n\n"
        )
    return (
        "# Into the FPGA, until power is removed.\n"
        f"program: viform.bit\n\t$(LOADER) -b {target.loader} viform.bit\n\n"
        "# Into the board's flash, for every power-on.\n"
        f"flash: viform.bit\n\t$(LOADER) -b {target.loader} -f viform.bit\n\n"
    )


def _vivado(target: Target, modules: Sequence[str], constraint: str) -> str:
    return f"""\
# {target.board}: viform.bit by Vivado in batch mode. Stops with an error if the timing is not met.
read_verilog {{{" ".join(modules)}}}
read_xdc {constraint}
synth_design -top {TOP} -part {target.part} -include_dirs .
opt_design
place_design
phys_opt_design
route_design
report_utilization -file utilization.rpt
report_timing_summary -file timing.rpt
foreach {{kind what}} {{max setup min hold}} {{
    set slack [get_property SLACK [get_timing_paths -delay_type $kind]]
    puts "viform: $what slack $slack ns"
    if {{$slack < 0}} {{ error "$what is missed by [expr -$slack] ns: see timing.rpt" }}
}}
write_bitstream -force viform.bit
"""


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
