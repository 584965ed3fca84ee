"""Registers by name from the `csr.csv` of any LiteX design, or from our own table.

Rows are `csr_base,name,address,,`, `csr_register,name,address,words,mode`, `constant,name,value,,`
and `memory_region,name,address,bytes,type` (LiteX, soc/integration/export.py); `#` begins a
comment, other rows are ignored. A register of several words has its most significant word first.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.imagers.catalogue import IMAGERS, design
from rtl_model.imagers.device.registers import CONSTANT
from rtl_model.registers import REGISTERS, Register, csr_csv

__all__ = ["CsrMap", "CsrRegister", "MemoryRegion", "default_map", "imager_map", "read_csr"]

_MODES = ("ro", "rw", "wo")
_TOP = 1 << 32
_WORDS_MAX = 1 << 10  # of a register; LiteX's longest are some tens


_NOTHING: Mapping[str, Register] = MappingProxyType({})


class CsrRegister(NamedTuple):
    """Byte address of the first word, number of words, "ro", "rw" or "wo"."""

    address: int
    words: int
    mode: str


class MemoryRegion(NamedTuple):
    """Byte address, size in bytes, LiteX's word for its type ("cached", "io", ..)."""

    address: int
    size: int
    kind: str


class CsrMap(NamedTuple):
    """What a `csr.csv` says. `data_width` bits of a register stand in each of its words (LiteX's
    config_csr_data_width, 8 or 32), which are `stride` bytes apart; `ours`: every register of our
    own board's table is there; `imager`: the kind of imager of ours that it is. `table`: what is
    known of each register beyond the file, where the design is one of ours."""

    registers: dict[str, CsrRegister]
    constants: dict[str, int | str]
    bases: dict[str, int]
    memories: dict[str, MemoryRegion]
    data_width: int
    stride: int
    ours: bool
    imager: str | None = None
    table: Mapping[str, Register] = _NOTHING

    def register(self, name: str) -> CsrRegister:
        """Returns a register, or InputError that names what is like it."""
        found = self.registers.get(name)
        if found is None:
            import difflib

            like = difflib.get_close_matches(name, self.registers, 3, 0.4)
            raise InputError(
                "a register",
                "one of this design" + (f" ({', '.join(like)}?)" if like else ""),
                repr(name),
                "`viform board regs --list` lists them",
            )
        return found

    def base(self, name: str) -> int:
        """Returns the byte address of a memory or of a group of registers; InputError for none."""
        if name in self.memories:
            return self.memories[name].address
        if name in self.bases:
            return self.bases[name]
        raise InputError(
            "a memory", "one of this design", repr(name), "give the csr.csv of the design"
        )


def default_map(geometry: Geometry | None = None) -> CsrMap:
    """Returns the map of our own board; sizes of memories are those of `geometry`."""
    return _parse("our own table", csr_csv(geometry or Geometry()))


def imager_map(name: str) -> CsrMap:
    """Returns the map of a conventional imager by its kind's name; InputError for none."""
    return _parse("our own table", design(name).csr_csv())


def read_csr(path: Path) -> CsrMap:
    """Returns what a `csr.csv` says. InputError, with the line, for a file that is none."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as exc:
        why = getattr(exc, "strerror", None) or "not text"
        raise InputError(f"{path}", "a csr.csv", f"unreadable ({why})", "check the name") from exc
    return _parse(str(path), text)


def _parse(name: str, text: str) -> CsrMap:
    registers: dict[str, CsrRegister] = {}
    constants: dict[str, int | str] = {}
    bases: dict[str, int] = {}
    memories: dict[str, MemoryRegion] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        place = f"line {number} of {name}"
        row = _row(place, line)
        kind = row[0]
        if kind not in ("csr_base", "csr_register", "constant", "memory_region"):
            continue
        if len(row) < 3 or not row[1]:
            raise _bad(place, "kind, name and value", line)
        key = row[1]
        if kind == "constant":
            constants[key] = _constant(row[2])
            continue
        address = _number(place, "an address below 2^32", row[2], 0, _TOP - 1)
        if kind == "csr_base":
            bases[key] = address
        elif len(row) < 5:
            raise _bad(place, "five columns", line)
        elif kind == "memory_region":
            size = _number(place, "a size in bytes", row[3], 0, _TOP - address)
            memories[key] = MemoryRegion(address, size, row[4])
        else:
            if address % 4:
                raise _bad(place, "the address of a word", row[2])
            if row[4] not in _MODES:
                raise _bad(place, "ro, rw or wo", row[4])
            most = min(_WORDS_MAX, (_TOP - address) // 4)
            words = _number(place, "a number of words", row[3], 1, most)
            registers[key] = CsrRegister(address, words, row[4])
    if not registers and not memories:
        raise InputError(
            name, "a csr.csv of LiteX", "without a register or memory", "write it with --csr-csv"
        )
    width = constants.get("config_csr_data_width", 32)
    if width not in (8, 32):
        raise InputError(
            f"config_csr_data_width of {name}", "8 or 32", repr(width), "mend the file"
        )
    alignment = constants.get("config_csr_alignment", 32)
    if alignment not in (32, 64):
        raise InputError(
            f"config_csr_alignment of {name}", "32 or 64", repr(alignment), "mend the file"
        )
    ours = {entry.name for entry in REGISTERS} <= registers.keys()
    table = {entry.name: entry for entry in REGISTERS} if ours else {}
    imager = constants.get(CONSTANT)
    if not ours and isinstance(imager, str) and imager in IMAGERS:
        table = {entry.name: entry for entry in design(imager).registers}
    fitting = bool(table) and table.keys() <= registers.keys()
    return CsrMap(
        registers, constants, bases, memories, int(width), int(alignment) // 8, ours,
        str(imager) if fitting and not ours else None, table if fitting else _NOTHING,
    )  # fmt: skip


def _row(place: str, line: str) -> list[str]:
    try:
        rows = list(csv.reader([line], strict=True))
    except csv.Error as exc:
        raise _bad(place, "values with commas between", line) from exc
    return [cell.strip() for cell in rows[0]] if rows else [""]


def _number(place: str, must: str, text: str, least: int, most: int) -> int:
    try:
        value = int(text, 16 if text.lower().startswith("0x") else 10)
    except ValueError as exc:
        raise _bad(place, must, text) from exc
    if not least <= value <= most:
        raise _bad(place, must, text)
    return value


def _constant(text: str) -> int | str:
    try:
        return int(text, 0)
    except ValueError:
        return text


def _bad(place: str, must: str, given: str) -> InputError:
    return InputError(place, must, repr(given[:80]), "write the file anew with LiteX's --csr-csv")
