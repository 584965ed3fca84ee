"""Waveforms of an imager: records (ps, signal, value) are written as .vcd or .fst.

VCD follows IEEE 1364-2005 §18, with time in picoseconds. FST is written by the library that comes
with Verilator (gtkwave's fstapi), which is compiled once; without Verilator it raises `InputError`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TextIO

from cosim import InputError
from cosim.files.atomic import atomic_write
from rtl_model.verilated import fst_library

_WIRE, _MODULE = 16, 0  # FST_VT_VCD_WIRE, FST_ST_VCD_MODULE of fstapi.h


class Signal(NamedTuple):
    """A signal of a trace.

    Attributes:
        name: dots separate scopes.
        width: bits.
        before: value before the first record.
    """

    name: str
    width: int = 1
    before: int = 0


class Record(NamedTuple):
    """A change of a signal.

    Attributes:
        ps: instant, ps.
        signal: name.
        value: new value, 0 to 2^width - 1.
    """

    ps: int
    signal: str
    value: int


def trace_ending(path: Path) -> str:
    """Ending ".vcd" or ".fst"; raises InputError for another ending."""
    ending = path.suffix.lower()
    if ending not in (".vcd", ".fst"):
        raise InputError(
            f"{path}", "a name that ends in .fst or .vcd", f"{path.suffix!r}", "rename it"
        )
    return ending


def write_trace(
    path: Path,
    signals: Sequence[Signal],
    records: Iterable[tuple[int, str, int]],
    *,
    top: str = "imager",
    end: int | None = None,
) -> int:
    """Writes a trace; the file appears under its name when it is complete.

    Args:
        path: file, .vcd or .fst.
        signals: all signals.
        records: (ps, signal, value) in order of time, from 0.
        top: name of the outermost scope.
        end: duration of the trace, ps; None ends it at the last record.

    Returns:
        the number of changes; a record that changes nothing is omitted.

    Raises ValueError for a record that goes back in time, names no signal, or does not fit it.
    """
    ending = trace_ending(path)
    with atomic_write(path) as part:
        sink: _Sink = _Vcd(part, signals, top) if ending == ".vcd" else _Fst(part, signals, top)
        try:
            return _pour(sink, signals, records, end)
        finally:
            sink.close()


class _Sink(Protocol):
    def time(self, ps: int) -> None: ...

    def change(self, signal: int, value: int) -> None: ...

    def close(self) -> None: ...


def _pour(
    sink: _Sink, signals: Sequence[Signal], records: Iterable[tuple[int, str, int]], end: int | None
) -> int:
    number = {signal.name: n for n, signal in enumerate(signals)}
    if len(number) != len(signals):
        raise ValueError("two signals of a trace have one name")
    now, changes = 0, 0
    values = [signal.before for signal in signals]
    sink.time(0)
    for n, value in enumerate(values):
        sink.change(n, value)
    for ps, name, value in records:
        if name not in number:
            raise ValueError(f"the trace has no signal {name}")
        n = number[name]
        if ps < now:
            raise ValueError(f"{name} at {ps} ps comes after {now} ps")
        if not 0 <= value < 1 << signals[n].width:
            raise ValueError(f"{name} has {signals[n].width} bits, not room for {value}")
        if value == values[n]:
            continue
        if ps > now:
            sink.time(ps)
            now = ps
        sink.change(n, value)
        values[n] = value
        changes += 1
    if end is not None and end > now:
        sink.time(end)
    return changes


def _scopes(signals: Sequence[Signal], top: str) -> list[tuple[list[str], str]]:
    """Scopes and local name of each signal."""
    return [([top, *signal.name.split(".")[:-1]], signal.name.split(".")[-1]) for signal in signals]


class _Vcd:
    def __init__(self, path: Path, signals: Sequence[Signal], top: str) -> None:
        self._file: TextIO = path.open("w", encoding="ascii")
        self._widths = [signal.width for signal in signals]
        self._keys = [_key(n) for n in range(len(signals))]
        lines = ["$timescale 1 ps $end"]
        open_now: list[str] = []
        for n, (scopes, name) in enumerate(_scopes(signals, top)):
            lines += _turn(open_now, scopes)
            open_now = scopes
            width = self._widths[n]
            bits = f" [{width - 1}:0]" if width > 1 else ""
            lines.append(f"$var wire {width} {self._keys[n]} {name}{bits} $end")
        lines += [*_turn(open_now, []), "$enddefinitions $end"]
        self._file.write("\n".join(lines) + "\n")

    def time(self, ps: int) -> None:
        self._file.write(f"#{ps}\n")

    def change(self, signal: int, value: int) -> None:
        if self._widths[signal] == 1:
            self._file.write(f"{value}{self._keys[signal]}\n")
        else:
            self._file.write(f"b{value:b} {self._keys[signal]}\n")

    def close(self) -> None:
        self._file.close()


def _turn(before: list[str], after: list[str]) -> list[str]:
    """VCD lines that leave the scopes of one signal and enter those of the next."""
    same = 0
    while same < min(len(before), len(after)) and before[same] == after[same]:
        same += 1
    lines = ["$upscope $end"] * (len(before) - same)
    return lines + [f"$scope module {name} $end" for name in after[same:]]


def _key(number: int) -> str:
    """A VCD identifier: printable characters, ! to ~."""
    text = ""
    while True:
        number, digit = divmod(number, 94)
        text += chr(33 + digit)
        if number == 0:
            return text
        number -= 1


class _Fst:
    def __init__(self, path: Path, signals: Sequence[Signal], top: str) -> None:
        self._library = _load()
        self._widths = [signal.width for signal in signals]
        writer = self._library.fstWriterCreate(str(path).encode(), 1)
        if not writer:
            raise InputError(
                f"{path}", "a file that can be written", "refused", "choose another name"
            )
        self._file: int | None = writer
        self._library.fstWriterSetTimescaleFromString(writer, b"1ps")
        self._handles = []
        open_now: list[str] = []
        for n, (scopes, name) in enumerate(_scopes(signals, top)):
            for line in _turn(open_now, scopes):
                if line.startswith("$scope"):
                    scope = line.split()[2].encode()
                    self._library.fstWriterSetScope(writer, _MODULE, scope, None)
                else:
                    self._library.fstWriterSetUpscope(writer)
            open_now = scopes
            width = self._widths[n]
            full = f"{name} [{width - 1}:0]" if width > 1 else name
            self._handles.append(
                self._library.fstWriterCreateVar(writer, _WIRE, 0, width, full.encode(), 0)
            )

    def time(self, ps: int) -> None:
        self._library.fstWriterEmitTimeChange(self._file, ps)

    def change(self, signal: int, value: int) -> None:
        text = f"{value:0{self._widths[signal]}b}".encode()
        self._library.fstWriterEmitValueChange(self._file, self._handles[signal], text)

    def close(self) -> None:
        if self._file is not None:
            self._library.fstWriterClose(self._file)
        self._file = None


def _load() -> Any:
    made = ctypes.CDLL(str(fst_library()))
    pointer, text = ctypes.c_void_p, ctypes.c_char_p
    made.fstWriterCreate.restype = pointer
    made.fstWriterCreate.argtypes = [text, ctypes.c_int]
    made.fstWriterClose.argtypes = [pointer]
    made.fstWriterSetTimescaleFromString.argtypes = [pointer, text]
    made.fstWriterSetScope.argtypes = [pointer, ctypes.c_int, text, text]
    made.fstWriterSetUpscope.argtypes = [pointer]
    made.fstWriterCreateVar.restype = ctypes.c_uint32
    made.fstWriterCreateVar.argtypes = [
        pointer, ctypes.c_int, ctypes.c_int, ctypes.c_uint32, text, ctypes.c_uint32,
    ]  # fmt: skip
    made.fstWriterEmitValueChange.argtypes = [pointer, ctypes.c_uint32, text]
    made.fstWriterEmitTimeChange.argtypes = [pointer, ctypes.c_uint64]
    return made
