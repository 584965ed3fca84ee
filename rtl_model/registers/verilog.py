"""The Verilog header of the register map, made from the table: `verilog/viform_registers.vh`.

Registers stand in groups of 64 words: an address is a group (upper 24 bits of the word address) and
an offset in it (lower 6 bits). The offsets of a group are without gaps, so that an address is known
if its offset is less than the group's count.
"""

from __future__ import annotations

from pathlib import Path

from rtl_model.registers.table import MEMORIES, REGISTERS

__all__ = ["HEADER", "verilog_header", "write_verilog_header"]

HEADER = Path(__file__).parents[1] / "verilog" / "viform_registers.vh"
GROUP_BYTES = 256


def verilog_header() -> str:
    """Returns the header's text: macros, so that a module which needs few of them is not warned of
    the others."""
    lines = [
        "// Made from rtl_model/registers/table.py by rtl_model/registers/verilog.py: do not edit.",
        "`ifndef VIFORM_REGISTERS_VH",
        "`define VIFORM_REGISTERS_VH",
    ]
    groups: dict[int, int] = {}
    for register in REGISTERS:
        name = "VIFORM_" + register.name.upper()
        group, offset = divmod(register.address, GROUP_BYTES)
        offset //= 4
        if group not in groups:
            prefix = register.name.split("_")[0].upper()
            count = sum(other.address // GROUP_BYTES == group for other in REGISTERS)
            lines += [
                "",
                f"`define VIFORM_GROUP_{prefix} 24'h{group:06x}",
                f"`define VIFORM_COUNT_{prefix} 6'd{count}",
            ]
        if offset != groups.get(group, 0):
            raise AssertionError(f"{register.name}: the offsets of a group must have no gap")
        groups[group] = offset + 1
        lines.append(f"`define {name} 6'h{offset:02x}")
        if isinstance(register.reset, int) and (register.reset or register.mode == "rw"):
            digits = -(-register.width // 4)
            lines.append(f"`define {name}_RESET {register.width}'h{register.reset:0{digits}x}")
        lines += [
            f"`define {name}_{field.name.upper()} "
            + (f"{field.high}:{field.low}" if field.high > field.low else f"{field.low}")
            for field in register.fields
        ]
    lines.append("")
    lines += [f"`define VIFORM_{m.name.upper()} 30'h{m.address // 4:08x}" for m in MEMORIES]
    return "\n".join([*lines, "", "`endif", ""])


def write_verilog_header(path: Path = HEADER) -> None:
    """Writes the header to `path`."""
    path.write_text(verilog_header(), encoding="utf-8")
