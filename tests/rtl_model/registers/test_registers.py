"""The register map is consistent, and the files generated from it are right."""

import csv
import io
from pathlib import Path

import pytest

from rtl_model.cycle import System
from rtl_model.geometry import Geometry
from rtl_model.registers import (
    MEMORIES,
    REGISTERS,
    Field,
    Register,
    csr_csv,
    identifier,
    parameters,
    reset_value,
)
from rtl_model.registers.document import document
from rtl_model.registers.table import PARAMETERS, Memory
from tests.rtl_model.registers.checks import faults

ROOT = Path(__file__).resolve().parents[3]
GEOMETRIES = [Geometry(), Geometry(rows=4095, columns=4096, lanes=64), Geometry(rows=1, columns=1)]
SOUND = Register("a_b", 0, "rw", 0, 32, "")


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_the_map_is_sound_and_its_parameters_are_the_ones_described(geometry):
    values = parameters(geometry)
    assert faults(REGISTERS, MEMORIES, values) == []
    assert values.keys() == PARAMETERS.keys()
    named = {entry.reset for entry in REGISTERS if isinstance(entry.reset, str)}
    assert named | {memory.size for memory in MEMORIES} == PARAMETERS.keys()


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        (SOUND, "a_b: named 2 times"),
        (SOUND._replace(name="a_c"), "overlaps"),
        (SOUND._replace(name="a_c", address=6), "not that of a word"),
        (SOUND._replace(name="a_c", address=8, width=33), "width 33"),
        (SOUND._replace(name="a_c", address=8, width=3, reset=8), "does not fit 3 bits"),
        (SOUND._replace(name="a_c", address=8, reset="NONE"), "no parameter NONE"),
        (SOUND._replace(name="ac", address=8), "underscore"),
        (SOUND._replace(name="a_c", address=8, width=4, fields=(Field("f", 4, 0, ""),)), "outside"),
        (
            SOUND._replace(name="a_c", address=8, fields=(Field("f", 4, 0, ""),) * 2),
            "overlaps another",
        ),
        (Memory("m_m", 0, "FOUR", "rw", ""), "overlaps"),
        (Memory("m_m", 8, "NONE", "rw", ""), "no parameter NONE"),
        (Memory("m_m", 8, "SIX", "rw", ""), "whole words"),
    ],
)
def test_a_planted_fault_is_found(entry, says):
    registers = [SOUND, entry] if isinstance(entry, Register) else [SOUND]
    memories = [entry] if isinstance(entry, Memory) else []
    found = faults(registers, memories, {"FOUR": 4, "SIX": 6})
    assert any(says in line for line in found)


def test_the_document_is_the_one_in_docs():
    assert (ROOT / "docs" / "registers.md").read_text(encoding="utf-8") == document()


def test_csr_csv_holds_every_register_in_litex_form():
    rows = list(csv.reader(io.StringIO(csr_csv(Geometry()))))
    assert {len(row) for row in rows} == {5}
    by_kind = {
        kind: {row[1]: row for row in rows if row[0] == kind} for kind in {r[0] for r in rows}
    }
    for register in REGISTERS:
        _, _, address, words, mode = by_kind["csr_register"][register.name]
        assert int(address, 16) == register.address
        assert (words, mode) == ("1", "ro" if register.mode == "ro" else "rw")
    assert by_kind["csr_base"]["identifier_mem"][2] == "0x00000800"
    assert by_kind["csr_base"]["sensor"][2] == "0x00000300"
    assert by_kind["constant"]["config_clock_frequency"][2] == "48000000"
    assert by_kind["constant"]["config_csr_data_width"][2] == "32"
    assert by_kind["memory_region"]["pattern_mem"][2:4] == ["0x00100000", "1024"]
    assert len(rows) == sum(len(kind) for kind in by_kind.values())  # no name twice


@pytest.mark.parametrize("geometry", [Geometry(), Geometry(rows=5, columns=70, lanes=64)])
def test_the_model_reads_as_after_reset_and_keeps_no_more_than_its_width(geometry):
    system = System(geometry, build=0xCAFE)
    values = parameters(geometry, 0xCAFE)
    for register in REGISTERS:
        if register.name != "ctrl_uptime" and not register.read_effect:
            assert system.read(register.address) == (
                0 if register.mode == "wo" else reset_value(register, values)
            ), register.name
    for register in REGISTERS:
        if register.mode == "rw" and register.name != "capture_pointer":
            system.write(register.address, 0xFFFFFFFF)
            assert system.read(register.address) == (1 << register.width) - 1, register.name
        elif register.mode == "ro" and register.name.startswith("ctrl_g"):
            system.write(register.address, 0)
            assert system.read(register.address) == reset_value(register, values)


def test_the_identifier_is_a_character_a_word_with_a_nul_and_nothing_beyond():
    system, base = System(), MEMORIES[0].address
    text = identifier(Geometry()).encode() + b"\0"
    assert bytes(system.read(base + 4 * n) for n in range(len(text))) == text
    assert system.read(0x020) == 0
    assert system.read(base + 4 * len(text)) == 0
    assert system.read(0x020) == 1
