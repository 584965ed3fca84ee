"""The register map as LiteX's `csr.csv`, which LiteX's host tools read.

Rows are `csr_base,name,address,,`, `csr_register,name,address,words,mode`, `constant,name,value,,`
and `memory_region,name,address,bytes,type`, all addresses in bytes (LiteX,
soc/integration/export.py). LiteX has no write-only registers, so these are listed as rw. They read
0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rtl_model.geometry import Geometry
from rtl_model.registers.table import MEMORIES, REGISTERS, Memory, Register, parameters

_CSR_BYTES = 0x1000  # registers and identifier have lower addresses


def csr_csv(geometry: Geometry) -> str:
    """The text of the `csr.csv` of a build."""
    return csr_text(REGISTERS, MEMORIES, parameters(geometry), geometry.clock_hz)


def csr_text(
    registers: Sequence[Register],
    memories: Sequence[Memory],
    values: Mapping[str, int],
    clock_hz: int,
    constants: Mapping[str, int | str] | None = None,
) -> str:
    """The text of the `csr.csv` of any register map.

    Args:
        registers, memories: the map.
        values: parameters of the build, which give the sizes of the memories.
        clock_hz: clock of the bus, Hz.
        constants: further constants, listed after LiteX's.
    """
    groups: dict[str, int] = {}
    for register in registers:
        group = register.name.split("_")[0]
        groups[group] = min(groups.get(group, register.address), register.address)
    for memory in memories:
        if memory.address < _CSR_BYTES:
            groups[memory.name] = memory.address
    listed: dict[str, int | str] = {
        "config_clock_frequency": clock_hz,
        "config_csr_data_width": 32,
        "config_csr_alignment": 32,
        "config_bus_standard": "WISHBONE",
        "config_bus_data_width": 32,
        "config_bus_address_width": 32,
        "config_bus_bursting": 0,
        **(constants or {}),
    }
    rows = [f"csr_base,{name},0x{address:08x},," for name, address in groups.items()]
    rows += [
        f"csr_register,{register.name},0x{register.address:08x},1,"
        + ("ro" if register.mode == "ro" else "rw")
        for register in registers
    ]
    rows += [f"constant,{name},{value},," for name, value in listed.items()]
    rows.append(f"memory_region,csr,0x{0:08x},{_CSR_BYTES},io")
    rows += [
        f"memory_region,{memory.name},0x{memory.address:08x},{values[memory.size]},io"
        for memory in memories
        if memory.address >= _CSR_BYTES
    ]
    return "\n".join(rows) + "\n"
