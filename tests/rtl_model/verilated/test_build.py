"""The library of a design: requirements, caching and concurrent builds."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.verilated import BuildFailed, VerilatedSystem, build, build_crc, library
from rtl_model.verilated.build import CACHE_BYTES, UNUSED_DAYS, _first_error, missing, prune
from rtl_model.verilated.system import trace_format

TINY = """
module tiny (input wire clk, output reg [7:0] count);
    always @(posedge clk) count <= count + 8'd1;
endmodule
"""
SHIM = """
#include "Vtop.h"
extern "C" int after(int clocks) {
    Vtop top;
    for (int n = 0; n < 2 * clocks; ++n) { top.clk = n & 1; top.eval(); }
    return top.count;
}
"""
CALL = """
import ctypes, sys
from pathlib import Path
from rtl_model.geometry import Geometry
from rtl_model.verilated import library
folder = Path(sys.argv[1])
made = library("tiny", Geometry(), folder / "shim.cpp", sources=folder)
print(made, ctypes.CDLL(str(made)).after(7))
"""


def tiny(folder):
    (folder / "tiny.v").write_text(TINY)
    (folder / "shim.cpp").write_text(SHIM)
    return folder


def test_missing_tools_are_named(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert missing() == ["verilator", "g++"]
    with pytest.raises(InputError, match=r"apt-get install verilator g\+\+$"):
        VerilatedSystem(Geometry())


def test_waveforms_go_by_the_ending(tmp_path):
    assert trace_format(tmp_path / "a.fst") == "fst"
    assert trace_format(tmp_path / "a.VCD") == "vcd"
    with pytest.raises(InputError, match=r"must be a name that ends in \.fst or \.vcd"):
        trace_format(tmp_path / "a.txt")


def test_the_build_number_follows_sources_and_parameters(tmp_path):
    first = build_crc(Geometry(), tiny(tmp_path))
    assert first == build_crc(Geometry(), tmp_path)
    assert first != build_crc(Geometry(rows=33), tmp_path)
    (tmp_path / "tiny.v").write_text(TINY + "// changed\n")
    assert first != build_crc(Geometry(), tmp_path)


@pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")
def test_a_header_of_several_shims_is_part_of_a_library_s_name(tmp_path, monkeypatch):
    monkeypatch.setenv("VIFORM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(build, "_SHARED", tmp_path)
    monkeypatch.setattr(build, "_build", lambda output, *_: output.write_bytes(b""))
    folder = tmp_path / "design"
    folder.mkdir()
    names = set()
    for text in ("one", "two", "two"):
        (tmp_path / "clocked.h").write_text(text)
        names.add(library("tiny", Geometry(), tiny(folder) / "shim.cpp", sources=folder))
    assert len(names) == 2


@pytest.mark.slow
@pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")
def test_two_processes_build_at_once_and_a_change_is_built_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("VIFORM_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "design"
    folder.mkdir()
    tiny(folder)
    command = [sys.executable, "-c", CALL, str(folder)]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    output = [process.communicate(timeout=600)[0].split() for process in both]
    assert output[0] == output[1]
    assert output[0][1] == "7"
    (folder / "tiny.v").write_text(TINY.replace("8'd1", "8'd2"))
    made, count = subprocess.run(
        command, stdout=subprocess.PIPE, text=True, check=True
    ).stdout.split()
    assert made != output[0][0]
    assert count == "14"
    assert not list((tmp_path / "cache" / "verilated").glob(".build-*"))
    (folder / "tiny.v").write_text("module tiny(; endmodule")
    with pytest.raises(BuildFailed, match=r"verilator failed: tiny\.v:1: .*syntax error") as fault:
        library("tiny", Geometry(), folder / "shim.cpp", sources=folder)
    assert "\n" not in str(fault.value)
    assert "syntax error" in fault.value.log.read_text()


def test_the_first_error_is_found():
    assert _first_error("%Warning: x\n%Error: /a/b.v:3:14: syntax error\n%Error: Exiting") == (
        "b.v:3: syntax error"
    )
    assert _first_error("%Error-PINNOTFOUND: b.v:9:2: Pin not found: 'x'") == (
        "b.v:9: Pin not found: 'x'"
    )
    output = "In file included\nshim.cpp:7:5: error: 'class Vtop' has no member named 'clk'\n"
    assert _first_error(output) == "shim.cpp:7: 'class Vtop' has no member named 'clk'"
    assert _first_error("\n%Error: Cannot find file\n") == "%Error: Cannot find file"
    assert _first_error("") == "no message"


def test_libraries_long_unused_are_removed(tmp_path, monkeypatch):
    """A loaded one still works. Beyond the size limit the longest unused are removed first."""
    monkeypatch.setenv("VIFORM_CACHE", str(tmp_path))
    folder = tmp_path / "verilated"
    folder.mkdir()
    now = 2_000_000_000.0
    ages = {"new.so": 0.0, "older.so": 86_400.0, "oldest.o": 5 * 86_400.0}
    ages |= {"unused.so": (UNUSED_DAYS + 1) * 86_400.0, "note.txt": 1e9}
    for name, age in ages.items():
        (folder / name).write_bytes(b"")
        (folder / name).with_suffix(".lock").write_bytes(b"")
        os.truncate(folder / name, CACHE_BYTES // 2)  # a hole: no room is taken
        os.utime(folder / name, (now - age, now - age))
    with (folder / "unused.so").open("rb") as still_open:
        assert {path.name for path in prune(now)} == {"oldest.o", "unused.so"}
        assert still_open.read(4) == bytes(4)
    left = {path.name for path in folder.iterdir()}
    assert left == {"new.so", "new.lock", "older.so", "older.lock", "note.txt", "note.lock"}
    assert prune(now) == []


def test_a_library_that_is_used_while_others_are_removed_stays(tmp_path, monkeypatch):
    monkeypatch.setenv("VIFORM_CACHE", str(tmp_path))
    folder = tmp_path / "verilated"
    folder.mkdir()
    now = 2_000_000_000.0
    for name, age in (("a.so", UNUSED_DAYS + 1), ("b.so", UNUSED_DAYS + 2)):
        (folder / name).touch()
        os.utime(folder / name, (now - age * 86_400, now - age * 86_400))
    unlink = Path.unlink

    def while_another_is_used(path, **more):
        os.utime(folder / "b.so", (now, now))
        unlink(path, **more)

    monkeypatch.setattr(Path, "unlink", while_another_is_used)
    assert prune(now) == [folder / "a.so"]
    assert (folder / "b.so").is_file()
