"""Consistency checks of a register map: names, addresses, widths, fields, reset values."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence

from rtl_model.registers.table import Memory, Register

_WORD = 4


def faults(
    registers: Sequence[Register], memories: Sequence[Memory], values: dict[str, int]
) -> list[str]:
    """Lists the contradictions in a register map, one line each.

    Args:
        registers, memories: the map.
        values: parameters of a build, which reset values and sizes of memories may name.
    """
    names = Counter([entry.name for entry in registers] + [entry.name for entry in memories])
    lines = [f"{name}: named {count} times" for name, count in names.items() if count > 1]
    for register in registers:
        lines += [f"{register.name}: {what}" for what in _register_faults(register, values)]
    spans = [(entry.address, entry.address + _WORD, entry.name) for entry in registers]
    for memory in memories:
        size = values.get(memory.size)
        if size is None:
            lines.append(f"{memory.name}: no parameter {memory.size} for its size")
        elif size < _WORD or size % _WORD or memory.address % _WORD:
            lines.append(f"{memory.name}: must be whole words, not {size} bytes")
        else:
            spans.append((memory.address, memory.address + size, memory.name))
    spans.sort()
    for (_, end, name), (start, _, later) in itertools.pairwise(spans):
        if start < end:
            lines.append(f"{later}: overlaps {name}")
    lines += [f"{name}: beyond 32 bits of address" for _, end, name in spans if end > 1 << 32]
    return lines


def _register_faults(register: Register, values: dict[str, int]) -> list[str]:
    lines = []
    if register.address < 0 or register.address % _WORD:
        lines.append(f"address {register.address:#x} is not that of a word")
    if not 1 <= register.width <= 32:
        lines.append(f"width {register.width} is not 1 to 32")
    if isinstance(register.reset, str) and register.reset not in values:
        lines.append(f"no parameter {register.reset} for its reset")
    else:
        reset = register.reset if isinstance(register.reset, int) else values[register.reset]
        if not 0 <= reset < 1 << register.width:
            lines.append(f"reset {reset:#x} does not fit {register.width} bits")
    if "_" not in register.name:
        lines.append("its name must begin with a group and an underscore")
    taken = 0
    for field in register.fields:
        if not 0 <= field.low <= field.high < register.width:
            lines.append(f"field {field.name} lies outside its {register.width} bits")
            continue
        mask = (1 << (field.high + 1)) - (1 << field.low)
        if taken & mask:
            lines.append(f"field {field.name} overlaps another")
        taken |= mask
    return lines
