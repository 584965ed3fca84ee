"""Builds shared libraries from the Verilog with Verilator and a shim, and caches them.

The name of a library contains a hash of its inputs (sources, shim, geometry, trace, tools, flags),
so that it is built once and never outdated. It is built in a temporary folder and then renamed. A
lock keeps a second process from building the same library. Libraries that have not been used for
long are removed when another is built.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import shutil
import subprocess
import tempfile
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Literal, Protocol

from cosim import InputError, ViformError
from cosim.compute.cache_folder import cache_folder
from cosim.errors import MissingPackages
from cosim.files.atomic import atomic_write
from rtl_model.geometry import Geometry

_SHARED = Path(__file__).parent.resolve()  # headers of several rooms' shims
VERILOG = Path(__file__).parents[1] / "verilog"
"""Folder of the design's sources."""

PACKAGES = {"verilator": "verilator", "g++": "g++"}
"""Programs that a build needs, and their system packages."""

Trace = Literal["", "fst", "vcd"]
"""Format of the waveforms that a library can write; "" for none."""

# Code that runs at every clock is optimised; code that runs once is not, which compiles faster.
# -fno-gnu-unique and -Bsymbolic keep two libraries in one process from sharing their statics.
_FLAGS = ("-std=c++17", "-fPIC", "-fno-gnu-unique", "-w")
_LINK = ("-shared", "-pthread", "-Wl,-Bsymbolic")
_VERILATE = ("--cc", "-O3", "--x-assign", "1", "--noassert", "--prefix", "Vtop", "-Wno-fatal")
_TIME_LIMIT = 900  # s, of one tool
_VERILATORS = re.compile(
    r"^%Error[^:\n]*: (?P<file>[^:\n]+):(?P<line>\d+):(?:\d+:)? (?P<text>.*)", re.M
)
_COMPILERS = re.compile(
    r"^(?P<file>[^:\n]+):(?P<line>\d+):(?:\d+:)? (?:fatal )?error: (?P<text>.*)", re.M
)

UNUSED_DAYS = 30
"""Libraries that have not been used for longer are removed when another is built."""
CACHE_BYTES = 1 << 30
"""Limit of all libraries together; beyond it the least recently used ones are removed."""
_IN_USE_S = (
    3600.0  # a library used more recently is never removed: a process may be about to load it
)


class BuildFailed(ViformError):
    """The Verilog or a shim does not compile: a fault of the sources.

    Attributes:
        tool: program that failed.
        first: its first error, `file:line: message`.
        log: file with its complete output, None if it could not be written.
    """

    def __init__(self, tool: str, first: str, log: Path | None = None) -> None:
        self.tool, self.first, self.log = tool, first, log
        super().__init__(tool, first, log)

    def __str__(self) -> str:
        where = "" if self.log is None else f" (complete output: {self.log})"
        return " ".join(f"{self.tool} failed: {self.first}{where}".split())


def missing() -> list[str]:
    """System packages that a build needs and that are missing."""
    return [package for name, package in PACKAGES.items() if shutil.which(name) is None]


def build_crc(geometry: Geometry, sources: Path | None = None) -> int:
    """CRC-32 of the parameters and the Verilog of a build, for `ctrl_build`."""
    crc = zlib.crc32(repr(sorted(geometry.verilog.items())).encode())
    for path in verilog_files(VERILOG if sources is None else sources):
        crc = zlib.crc32(path.name.encode() + b"\0" + path.read_bytes(), crc)
    return crc


class Build(Protocol):
    """What is built: the size of a board, or of a module."""

    @property
    def verilog(self) -> dict[str, int]:
        """Parameters of the Verilog by name."""
        ...


def library(
    top: str,
    geometry: Build,
    shim: Path,
    *,
    sources: Path | None = None,
    trace: Trace = "",
    build: int = 0,
    settings: Mapping[str, int] | None = None,
) -> Path:
    """The shared library of a module and a shim, built unless it is cached.

    Args:
        top: name of the Verilog module. The shim sees its class as `Vtop` of "Vtop.h".
        geometry: geometry of the build; its parameters that the module has are set.
        shim: C++ source with `extern "C"` functions. It sees the parameters as macros, such as
            VIFORM_ROWS, VIFORM_COLUMNS and VIFORM_LANES, and, with a trace, VIFORM_FST or
            VIFORM_VCD.
        sources: folder of the Verilog; the design's if None.
        trace: format of the waveforms that the shim writes.
        build: parameter BUILD, the value of `ctrl_build` (see `build_crc`).
        settings: further parameters of the module, which the shim sees like those of the geometry.

    Raises:
        InputError: if a tool or the module is missing.
        BuildFailed: if the sources do not compile.
    """
    _need_tools("the simulator of the Verilog")
    if trace == "fst":
        _need_zlib()
    folder = (VERILOG if sources is None else sources).resolve()
    parameters = geometry.verilog | dict(settings or {})
    try:
        text = (folder / f"{top}.v").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as exc:
        raise InputError(
            "a folder of Verilog", f"one with a readable {top}.v", f"{sources}",
            "name another, or add that file",
        ) from exc  # fmt: skip
    known = {name: value for name, value in parameters.items() if f"] {name} =" in text}
    if "] BUILD =" in text:
        known["BUILD"] = build
    verilate = [*_VERILATE, "--top-module", top]
    verilate += [f"-G{name}={value}" for name, value in known.items()]
    verilate += {"": [], "fst": ["--trace-fst"], "vcd": ["--trace"]}[trace]
    flags = [*_FLAGS, *(f"-DVIFORM_{name}={value}" for name, value in parameters.items())]
    flags += {"": [], "fst": ["-DVIFORM_FST"], "vcd": ["-DVIFORM_VCD"]}[trace]
    key = hashlib.sha256(repr((verilate, flags, _LINK, _versions())).encode())
    headers = {*shim.parent.glob("*.h"), *_SHARED.glob("*.h")}
    for path in [*verilog_files(folder), shim, *sorted(headers)]:
        key.update(f"\0{path.name}\0".encode() + path.read_bytes())
    output = _cache() / f"{top}-{key.hexdigest()[:24]}.so"
    with _locked(output.with_suffix(".lock"), unless=output):
        if not output.is_file():
            _build(output, [*verilate, f"-I{folder}", f"{folder / top}.v"], flags, shim, trace)
            prune()
    return _used(output)


def fst_library() -> Path:
    """Verilator's FST library (gtkwave's fstapi) as a shared library, built unless it is cached.

    Raises InputError if a tool is missing.
    """
    _need_tools("the writer of .fst")
    _need_zlib()
    folder = Path(_versions()[-1]) / "include" / "gtkwave"
    units = [folder / name for name in ("fstapi.c", "fastlz.c", "lz4.c")]
    flags = ["-O2", "-fPIC", "-w", "-shared", f"-I{folder}"]
    flags += ['-DFST_CONFIG_INCLUDE="fst_config.h"']
    key = hashlib.sha256(repr((flags, _versions())).encode())
    for unit in units:
        key.update(unit.read_bytes())
    output = _cache() / f"fstapi-{key.hexdigest()[:24]}.so"
    with _locked(output.with_suffix(".lock"), unless=output):
        if not output.is_file():
            with tempfile.TemporaryDirectory(prefix=".build-", dir=output.parent) as part:
                command = ["gcc", *flags, *map(str, units), "-lz", "-lpthread", "-o", "output.so"]
                _tool(command, Path(part))
                os.replace(Path(part) / "output.so", output)
    return _used(output)


def _need_tools(what: str) -> None:
    lacking = missing()
    if lacking:
        raise MissingPackages(
            what,
            "installed (verilator, g++)",
            f"without {' and '.join(lacking)}",
            f"install the system packages: apt-get install {' '.join(lacking)}",
            [*PACKAGES.values(), "zlib1g-dev"],  # zlib for waveforms
        )


def _need_zlib() -> None:
    if not _has_zlib():
        raise InputError(
            "the header zlib.h",
            "installed, for waveforms as .fst",
            "absent",
            "install it (apt-get install zlib1g-dev), or write a .vcd",
        )


def _build(
    output: Path, verilate: Sequence[str], flags: Sequence[str], shim: Path, t: Trace
) -> None:
    runtime = _runtime(t)
    with tempfile.TemporaryDirectory(prefix=".build-", dir=output.parent) as name:
        part = Path(name)
        _tool(["verilator", *verilate, "-Mdir", name], part)
        units = sorted(path.name for path in part.glob("Vtop*.cpp"))
        slow = [
            unit for unit in units if "Slow" in unit or "Syms" in unit
        ]  # run once, or for the trace
        often = [unit for unit in units if unit not in slow]
        (part / "once.cpp").write_text(_include(slow), encoding="utf-8")
        (part / "often.cpp").write_text(_include([*often, str(shim.resolve())]), encoding="utf-8")
        folders = [f"-I{name}", f"-I{shim.parent.resolve()}", f"-I{_SHARED}"]
        compiler = ["g++", *flags, *_runtime_flags(t), *folders]
        commands = [
            [*compiler, "-O0", "-c", "once.cpp"],
            [*compiler, "-O3", "-c", "often.cpp"],
        ]
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(_tool, commands, [part, part]))
        link = ["g++", "often.o", "once.o", str(runtime), *_LINK, "-o", "output.so"]
        _tool([*link, *(["-lz"] if t == "fst" else [])], part)
        os.replace(part / "output.so", output)


def _include(files: Iterable[str]) -> str:
    return "".join(f'#include "{file}"\n' for file in files)


def _runtime(trace: Trace) -> Path:
    """Verilator's runtime as one object file, which all designs share."""
    flags = [*_FLAGS, *_runtime_flags(trace)]
    key = hashlib.sha256(repr((flags, _versions())).encode()).hexdigest()[:24]
    output = _cache() / f"runtime-{key}.o"
    with _locked(output.with_suffix(".lock"), unless=output):
        if not output.is_file():
            with tempfile.TemporaryDirectory(prefix=".build-", dir=output.parent) as name:
                names = ["verilated", "verilated_threads"]
                names += [f"verilated_{trace}_c"] if trace else []
                text = _include(f"{unit}.cpp" for unit in names)
                (Path(name) / "runtime.cpp").write_text(text, encoding="utf-8")
                _tool(["g++", *flags, "-O1", "-c", "runtime.cpp", "-o", "output.o"], Path(name))
                os.replace(Path(name) / "output.o", output)
    return _used(output)


def _used(output: Path) -> Path:
    """Marks a file of the cache as recently used."""
    with suppress(OSError):  # not permitted, or removed: then it is built again next time
        os.utime(output)
    return output


def prune(now: float | None = None) -> list[Path]:
    """Removes libraries that were not used for `UNUSED_DAYS`, and beyond `CACHE_BYTES` the least
    recently used ones; returns their files.

    A process that has loaded a library can use it further.

    Args:
        now: s since 1970; the present time if None.
    """
    now = time.time() if now is None else now
    files = []
    for path in _cache().iterdir():
        with suppress(OSError):  # another process may have removed it
            if path.suffix in (".so", ".o"):
                stat = path.stat()
                files.append((stat.st_mtime, stat.st_size, path))
    total, gone = 0, []
    for used, size, path in sorted(files, reverse=True):
        total += size
        idle = now - used
        if idle > UNUSED_DAYS * 86_400 or (total > CACHE_BYTES and idle > _IN_USE_S):
            with suppress(OSError):
                if path.stat().st_mtime != used:  # another process has used it meanwhile
                    continue
                path.unlink()
                path.with_suffix(".lock").unlink(missing_ok=True)
                gone.append(path)
                total -= size
    return gone


def _runtime_flags(trace: Trace) -> list[str]:
    include = Path(_versions()[-1]) / "include"
    flags = [f"-I{include}", f"-I{include / 'vltstd'}", f"-I{include / 'gtkwave'}"]
    flags += [f"-DVM_TRACE={int(bool(trace))}", f"-DVM_TRACE_FST={int(trace == 'fst')}"]
    return [*flags, f"-DVM_TRACE_VCD={int(trace == 'vcd')}", "-DVM_COVERAGE=0", "-DVM_SC=0"]


def _tool(command: Sequence[str], folder: Path) -> str:
    """Runs a tool in `folder`; returns its standard output."""
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, timeout=_TIME_LIMIT, check=False,
            encoding="utf-8", errors="replace",
        )  # fmt: skip
    except subprocess.TimeoutExpired as exc:
        raise BuildFailed(command[0], f"it did not end within {_TIME_LIMIT} s") from exc
    if done.returncode:
        words = done.stdout + done.stderr
        raise BuildFailed(command[0], _first_error(words), _write_log(command, words))
    return done.stdout


def _first_error(words: str) -> str:
    """`file:line: message` of a tool's first error.

    It parses Verilator's `%Error: file:line:column: ..` and a compiler's
    `file:line:column: error: ..`. Without either it is the first line that mentions an error.
    """
    for form in (_VERILATORS, _COMPILERS):
        match = form.search(words)
        if match:
            return f"{Path(match['file']).name}:{match['line']}: {match['text'].strip()}"
    plain = [line.strip() for line in words.splitlines() if line.strip()]
    return next((line for line in plain if "rror" in line), plain[0] if plain else "no message")


def _write_log(command: Sequence[str], words: str) -> Path | None:
    """Writes the output of a tool into the cache, replacing the previous one."""
    path = _cache() / f"failed-{command[0]}.log"
    try:
        with atomic_write(path) as part:
            part.write_text(f"$ {' '.join(command)}\n{words}", encoding="utf-8")
    except (OSError, ViformError):
        return None
    return path


@cache
def _has_zlib() -> bool:
    """Whether the compiler finds zlib's header, which Verilator's FST writer includes."""
    command = ["g++", "-E", "-x", "c++", "-include", "zlib.h", os.devnull]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@cache
def _versions() -> tuple[str, str, str]:
    """Version of Verilator, version of the compiler, folder of Verilator's runtime."""
    here = Path()
    version = _tool(["verilator", "--version"], here).strip()
    compiler = _tool(["g++", "-dumpfullversion"], here).strip()
    return version, compiler, _tool(["verilator", "--getenv", "VERILATOR_ROOT"], here).strip()


def verilog_files(folder: Path) -> list[Path]:
    """Verilog files and headers in a folder, sorted by name."""
    return sorted((*folder.glob("*.v"), *folder.glob("*.vh")))


def _cache() -> Path:
    folder = cache_folder() / "verilated"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def _locked(path: Path, *, unless: Path) -> Iterator[None]:
    """Context that holds a lock between processes, unless the file `unless` exists."""
    if unless.is_file():
        yield
        return
    with path.open("w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
