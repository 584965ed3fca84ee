"""The compiled scan gives the same tiles as the numpy reference, to the bit and the clock."""

import numpy as np
import pytest

from rtl_model.cycle import System
from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS
from tests.rtl_model.cycle.edge_by_edge import EdgeByEdgeSensor

ADDRESS = {register.name: register.address for register in REGISTERS}
PATTERN = next(memory.address for memory in MEMORIES if memory.name == "pattern_mem")

GEOMETRIES = [
    Geometry(rows=3, columns=32, clock_hz=4_000_000),
    Geometry(rows=4, columns=45, lanes=32, clock_hz=2_000_000),
    Geometry(rows=2, columns=100, lanes=64, clock_hz=2_400_000),
]


def random_writes(geometry, seed, clocks):
    """All kinds of writes at random clocks, several in a frame, with critical values."""
    rng = np.random.default_rng(seed)
    writes = [
        (n, PATTERN + 4 * n, int(rng.integers(1 << 32))) for n in range(geometry.pattern_bytes // 4)
    ]
    start = len(writes)
    writes.append((start, ADDRESS["sensor_tick_clocks"], 0))
    start += 1
    writes.append((start, ADDRESS["sensor_run"], 1))
    last = (geometry.rows - 1, geometry.columns - 1)
    ticks = geometry.tick_minimum + np.array([-3, 0, 1, 7])
    for clock in np.flatnonzero(rng.random(clocks) < 0.02):
        if clock <= start:
            continue
        name, value = [
            ("sensor_threshold", rng.integers(16)),
            ("sensor_reset_rule", rng.integers(4)),
            ("sensor_clock_select", rng.integers(2)),
            ("sensor_pattern", rng.integers(4)),
            ("sensor_level", rng.integers(256)),
            ("sensor_tick_clocks", rng.choice(ticks)),
            ("sensor_rows", rng.integers(last[0] + 1) | last[0] << 16),
            ("sensor_rows", rng.integers(last[0] + 1) << 16),
            ("sensor_rows", last[0] << 16),
            ("sensor_columns", rng.integers(last[1] + 1) | last[1] << 16),
            ("sensor_columns", rng.integers(last[1] + 1) << 16),
            ("sensor_columns", last[1] << 16),
            ("sensor_clear", 1),
            ("sensor_reading", rng.integers(5)),
            ("sensor_run", 0),
            *[("sensor_run", 1)] * 6,
            ("pattern", rng.integers(1 << 32)),
            ("pattern", rng.integers(1 << 32)),
        ][rng.integers(23)]
        if name == "pattern":
            place = PATTERN + 4 * int(rng.integers(geometry.pattern_bytes // 4))
        else:
            place = ADDRESS[name]
        writes.append((int(clock), place, int(value)))
    return writes


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_writes_at_random_clocks(geometry, seed):
    clocks = 4000
    writes = random_writes(geometry, seed, clocks)
    truth = EdgeByEdgeSensor(geometry).run(clocks, writes)
    tiles = System(geometry).run(clocks, writes)
    assert truth.size > 150
    assert np.bitwise_count(truth["bits"]).sum() > 150
    np.testing.assert_array_equal(tiles, truth)


@pytest.mark.parametrize(
    ("threshold", "rule"), [(k, (k + n) % 4) for k in range(16) for n in (0, 1)]
)
def test_every_threshold_and_rule(threshold, rule):
    geometry = GEOMETRIES[0]
    rng = np.random.default_rng(threshold)
    values = {"threshold": threshold, "reset_rule": rule, "clock_select": threshold & 1}
    values |= {"tick_clocks": 0, "run": 1}
    writes = [
        (n, ADDRESS[f"sensor_{name}"], value) for n, (name, value) in enumerate(values.items())
    ]
    writes += [
        (10 + n, PATTERN + 4 * n, int(rng.integers(1 << 32)))
        for n in range(geometry.pattern_bytes // 4)
    ]
    clocks = 3000
    truth = EdgeByEdgeSensor(geometry).run(clocks, writes)
    tiles = System(geometry).run(clocks, writes)
    np.testing.assert_array_equal(tiles, truth)
    assert truth["bits"].any()


def test_a_split_run_gives_the_same_tiles():
    geometry = GEOMETRIES[1]
    writes = random_writes(geometry, 7, 3000)
    whole = System(geometry).run(3000, writes)
    system, parts = System(geometry), []
    for stop in (1, 2, 500, 501, 1777, 3000):
        due = [write for write in writes if system.clock <= write[0] < stop]
        parts.append(system.run(stop - system.clock, due))
    np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize("edge", range(5))
def test_a_write_to_the_pattern_is_seen_two_edges_later(edge):
    """Row 1's tile is computed at s + 1 + row_clocks = s + 6 and reads memory an edge before."""
    geometry = GEOMETRIES[0]
    due = 1 + geometry.row_clocks + 1  # run is written at edge 0, so s = 1
    write = due - 4 + edge
    writes = [(0, ADDRESS["sensor_run"], 1), (1, ADDRESS["sensor_threshold"], 0)]
    writes.append((write, PATTERN + geometry.lanes, 255))
    tiles = System(geometry).run(due + 1, writes)
    assert tiles[-1]["clock"] == due
    assert tiles[-1]["bits"] == (1 if write < due - 1 else 0)
