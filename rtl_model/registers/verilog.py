"""The Verilog header of the register map, `verilog/viform_registers.vh`. After a change of the map,
run `python -m rtl_model.registers.verilog > rtl_model/verilog/viform_registers.vh`.

Registers form groups of 64 words. The upper 24 bits of a word address are the group, the lower 6
bits the offset. The offsets of a group have no gaps, so an address is valid if its offset is less
than the number of registers in the group.
"""

from __future__ import annotations

from pathlib import Path

from rtl_model.registers.table import MEMORIES, REGISTERS

HEADER = Path(__file__).parents[1] / "verilog" / "viform_registers.vh"
GROUP_BYTES = 256


def verilog_header() -> str:
    """The text of the header. It defines macros, because unused parameters would cause warnings."""
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


if __name__ == "__main__":
    print(verilog_header(), end="")
