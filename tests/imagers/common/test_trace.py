"""Traces: what is written is what was recorded, in either format, and nothing else is let in."""

import ctypes
import random
import re
import shutil

import pytest

from cosim import InputError
from imagers.common.trace import Signal, trace_ending, write_trace
from tests.imagers.vcd import read_vcd

SIGNALS = (Signal("fval"), Signal("drive.dg", 1, 1), Signal("drive.row", 10), Signal("drive.a.b"))


def read_fst(path, tmp_path):
    """An FST by way of its own library's reader, which gives a VCD."""
    from rtl_model.verilated import fst_library

    made = ctypes.CDLL(str(fst_library()))
    libc = ctypes.CDLL(None)
    made.fstReaderOpen.restype = ctypes.c_void_p
    libc.fopen.restype = ctypes.c_void_p
    made.fstReaderProcessHier.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    made.fstReaderSetFacProcessMaskAll.argtypes = [ctypes.c_void_p]
    made.fstReaderIterBlocks.argtypes = [ctypes.c_void_p] * 4
    made.fstReaderClose.argtypes = [ctypes.c_void_p]
    libc.fclose.argtypes = [ctypes.c_void_p]
    vcd = tmp_path / "back.vcd"
    reader = made.fstReaderOpen(str(path).encode())
    assert reader
    file = libc.fopen(str(vcd).encode(), b"w")
    made.fstReaderProcessHier(reader, file)
    made.fstReaderSetFacProcessMaskAll(reader)
    made.fstReaderIterBlocks(reader, None, None, file)
    made.fstReaderClose(reader)
    libc.fclose(file)
    text = vcd.read_text()
    text = re.sub(r"\$timescale\s+1ps\s+\$end", "$timescale 1 ps $end", text)
    return read_vcd(text)


def course(count=400, seed=3):
    rng = random.Random(seed)
    now, records = 0, []
    for _ in range(count):
        now += rng.choice((0, 0, 1, 100_000, 10**12))
        signal = rng.choice(SIGNALS)
        records.append((now, signal.name, rng.randrange(1 << signal.width)))
    return records


def changes(records):
    """What a trace must hold: values before, then every change, the last of one instant."""
    wanted = {signal.name: {0: signal.before} for signal in SIGNALS}
    last = {signal.name: signal.before for signal in SIGNALS}
    for ps, name, value in records:
        if value != last[name]:
            wanted[name][ps] = last[name] = value
    return {name: list(course.items()) for name, course in wanted.items()}


def settled(course):
    """The last value of each instant."""
    return list(dict(course).items())


@pytest.mark.parametrize("ending", [".vcd", ".fst"])
def test_a_trace_reads_back_as_it_was_recorded(tmp_path, ending):
    if ending == ".fst" and shutil.which("verilator") is None:
        pytest.skip("the writer of FST comes with Verilator")
    path = tmp_path / f"trace{ending}"
    records = course()
    count = write_trace(path, SIGNALS, iter(records), end=records[-1][0] + 5)
    found = read_vcd(path.read_text()) if ending == ".vcd" else read_fst(path, tmp_path)
    assert {name.split(" ")[0]: width for name, (width, _) in found.items()} == {
        signal.name: signal.width for signal in SIGNALS
    }
    wanted = changes(records)
    assert count >= sum(len(course) - 1 for course in wanted.values()) > 100
    for name, (_, got) in found.items():
        course_back, before = [], None
        for ps, value in settled(got):
            if value != before:
                course_back.append((ps, value))
            before = value
        clean, before = [], None
        for ps, value in wanted[name]:
            if value != before:
                clean.append((ps, value))
            before = value
        assert course_back == clean, name


@pytest.mark.parametrize(
    ("records", "says"),
    [
        ([(5, "fval", 1), (4, "fval", 0)], "comes after"),
        ([(5, "none", 1)], "no signal none"),
        ([(5, "fval", 2)], "has 1 bits"),
        ([(5, "drive.row", -1)], "has 10 bits"),
    ],
)
def test_a_record_that_cannot_be_is_refused_and_leaves_no_file(tmp_path, records, says):
    path = tmp_path / "a.vcd"
    with pytest.raises(ValueError, match=says):
        write_trace(path, SIGNALS, records)
    assert list(tmp_path.iterdir()) == []


def test_names_that_cannot_be(tmp_path):
    with pytest.raises(InputError, match=r"must be a name that ends in \.fst or \.vcd"):
        trace_ending(tmp_path / "a.txt")
    with pytest.raises(InputError, match="folder that exists"):
        write_trace(tmp_path / "none" / "a.vcd", SIGNALS, [])
    with pytest.raises(ValueError, match="one name"):
        write_trace(tmp_path / "a.vcd", (Signal("a"), Signal("a")), [])
