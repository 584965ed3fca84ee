"""Register maps from the `csr.csv` of any LiteX design, or from a table of this project.

Rows are `csr_base,name,address,,`, `csr_register,name,address,words,mode`, `constant,name,value,,`
and `memory_region,name,address,bytes,type` (LiteX, soc/integration/export.py). `#` begins a
comment, other rows are ignored. A register of several words has its most significant word first.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from cosim import InputError
from cosim.config.toml import read_text
from rtl_model.geometry import Geometry
from rtl_model.registers import REGISTERS, Register, csr_csv
from rtl_model.registers.design import CONSTANT, NO_DEVICES, Design, Devices

_MODES = ("ro", "rw", "wo")
_TOP = 1 << 32
_WORDS_MAX = 1 << 10  # of a register; the longest of LiteX have some tens

_NOTHING: Mapping[str, Register] = MappingProxyType({})


class CsrRegister(NamedTuple):
    """One register.

    Attributes:
        address: address of the first word, bytes.
        words: number of words.
        mode: "ro", "rw" or "wo".
    """

    address: int
    words: int
    mode: str


class MemoryRegion(NamedTuple):
    """One memory.

    Attributes:
        address: address of the first word, bytes.
        size: bytes.
        kind: LiteX's name of its type, such as "cached" or "io".
    """

    address: int
    size: int
    kind: str


class CsrMap(NamedTuple):
    """The contents of a `csr.csv`.

    Attributes:
        registers, memories: registers and memories by name.
        constants: values by name.
        bases: byte address of each group of registers by name.
        data_width: bits of a register in each of its words, 8 or 32 (LiteX's
            config_csr_data_width).
        stride: distance of the words of a register, bytes.
        is_viform_board: whether every register of the Viform board exists.
        imager: name of the device of this project that the map describes, if it is none of the
            spike camera's boards, else None.
        number: value of that device's register `ctrl_imager`, else None.
        table: further facts on each register of a Viform board or imager, else empty.
    """

    registers: dict[str, CsrRegister]
    constants: dict[str, int | str]
    bases: dict[str, int]
    memories: dict[str, MemoryRegion]
    data_width: int
    stride: int
    is_viform_board: bool
    imager: str | None = None
    number: int | None = None
    table: Mapping[str, Register] = _NOTHING

    def register(self, name: str) -> CsrRegister:
        """A register by name. Raises InputError with similar names if there is none."""
        register = self.registers.get(name)
        if register is None:
            import difflib

            like = difflib.get_close_matches(name, self.registers, 3, 0.4)
            raise InputError(
                "a register",
                "one of this design" + (f" ({', '.join(like)}?)" if like else ""),
                repr(name),
                "`viform board regs --list` lists them",
            )
        return register

    def base(self, name: str) -> int:
        """Byte address of a memory or a group of registers. Raises InputError if there is none."""
        if name in self.memories:
            return self.memories[name].address
        if name in self.bases:
            return self.bases[name]
        raise InputError(
            "a memory", "one of this design", repr(name), "give the csr.csv of the design"
        )


def default_map(geometry: Geometry | None = None) -> CsrMap:
    """The map of the Viform board, with the memory sizes of `geometry`."""
    return _parse("the register table", csr_csv(geometry or Geometry()))


def device_map(design: Design) -> CsrMap:
    """The map of another device than the Viform board, by its register table."""
    return _parse("the register table", design.csr_csv(), lambda name: design)


def read_csr(path: Path, devices: Devices = NO_DEVICES) -> CsrMap:
    """Reads a `csr.csv`. Raises InputError, with the line, for another file.

    Args:
        path: the file.
        devices: devices whose registers are known beyond what the file states.
    """
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as exc:
        why = getattr(exc, "strerror", None) or "not text"
        raise InputError(f"{path}", "a csr.csv", f"unreadable ({why})", "check the name") from exc

    def known(name: str) -> Design | None:
        return devices[name].design() if name in devices else None

    return _parse(str(path), text, known)


def _parse(
    name: str, text: str, known: Callable[[str], Design | None] = lambda name: None
) -> CsrMap:
    """known: name of a device -> its registers, or None."""
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
            f"config_csr_data_width of {name}", "8 or 32", repr(width), "correct the file"
        )
    alignment = constants.get("config_csr_alignment", 32)
    if alignment not in (32, 64):
        raise InputError(
            f"config_csr_alignment of {name}", "32 or 64", repr(alignment), "correct the file"
        )
    is_viform_board = {entry.name for entry in REGISTERS} <= registers.keys()
    table = {entry.name: entry for entry in REGISTERS} if is_viform_board else {}
    imager = constants.get(CONSTANT)
    design = None if is_viform_board or not isinstance(imager, str) else known(imager)
    if design is not None:
        table = {entry.name: entry for entry in design.registers}
    complete = bool(table) and table.keys() <= registers.keys()
    return CsrMap(
        registers, constants, bases, memories, int(width), int(alignment) // 8, is_viform_board,
        design.name if design and complete else None,
        design.number if design and complete else None, table if complete else _NOTHING,
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


def _bad(place: str, must: str, actual: str) -> InputError:
    return InputError(place, must, repr(actual[:80]), "write the file again with LiteX's --csr-csv")
