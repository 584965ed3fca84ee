"""The base graphs: their size and structure, and the sets of lifting sizes."""

import itertools
from importlib.resources import files

import fastcrc
import numpy as np
import pytest

from link.coding.ldpc_graph import LIFTINGS, base_graph

SHAPES = {1: (46, 68, 22, 316), 2: (42, 52, 10, 197)}
"""Rows, columns, columns of data, edges (TS 38.212, clause 5.3.2)."""
CRC32C = {1: 0xB1A47CB5, 2: 0x5738A915}
"""Of the tables as they were compared with a second copy."""


def four_cycles(graph, lifting):
    """Closed paths of four edges in the lifted graph, in units of the lifting size."""
    rows = [{} for _ in range(graph.rows)]
    for row, column, values in zip(graph.row, graph.column, graph.values, strict=True):
        rows[row][int(column)] = values[LIFTINGS[lifting]] % lifting
    found = 0
    for a, b in itertools.combinations(rows, 2):
        turns = [(a[c] - b[c]) % lifting for c in a.keys() & b.keys()]
        found += len(turns) - len(set(turns))
    return found


def test_the_lifting_sizes_are_those_of_the_standard():
    assert len(LIFTINGS) == 51 and min(LIFTINGS) == 2 and max(LIFTINGS) == 384
    last = {z: s for z, s in LIFTINGS.items() if 2 * z not in LIFTINGS}
    assert last == {256: 0, 384: 1, 320: 2, 224: 3, 288: 4, 352: 5, 208: 6, 240: 7}
    assert all(LIFTINGS[2 * z] == s for z, s in LIFTINGS.items() if z not in last)


@pytest.mark.parametrize("number", SHAPES)
def test_the_tables_are_those_that_were_compared(number):
    graph = base_graph(number)
    shape = graph.rows, graph.column.max() + 1, graph.data_columns, len(graph.row)
    assert shape == SHAPES[number]
    text = (files("link.coding") / f"ldpc_graph_{number}.csv").read_bytes()
    assert fastcrc.crc32.iscsi(text) == CRC32C[number]
    assert len(set(zip(graph.row, graph.column, strict=True))) == len(graph.row)
    assert (np.diff(graph.row) >= 0).all()
    assert graph.values.min() == 0 and graph.values.max() < 384


@pytest.mark.parametrize("number", SHAPES)
def test_every_row_has_the_parity_column_that_it_gives(number):
    graph = base_graph(number)
    first = graph.data_columns
    for row in range(graph.rows):
        if row == 3:
            continue
        here = (graph.row == row) & (graph.column == first + row + (row < 3))
        assert (graph.values[here] == 0).all() and here.sum() == 1
        later = graph.column[(graph.row > row) & (graph.row != 3)]
        assert row < 3 or first + row not in later
    core = graph.values[(graph.row < 4) & (graph.column == first)]
    assert len(core) == 3
    for three in core.T:
        assert len(set(three.tolist())) == 2


@pytest.mark.parametrize("number", SHAPES)
@pytest.mark.parametrize("lifting", [256, 288, 320, 352, 384])
def test_no_four_bits_and_checks_are_a_cycle(number, lifting):
    assert four_cycles(base_graph(number), lifting) == 0


def test_there_is_no_third_graph():
    with pytest.raises(ValueError, match="graph must be 1 or 2, not 3"):
        base_graph(3)
