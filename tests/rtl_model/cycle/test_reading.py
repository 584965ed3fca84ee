"""A reading of the charges has the levels of the camera model, and leaves the run as it was."""

import numpy as np
import pytest

from rtl_model.cycle import Settings, System, planes
from rtl_model.cycle.array import rows_of
from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS, quantum
from sensor.reconstruct.readings import quantised

ADDRESS = {register.name: register.address for register in REGISTERS}
PATTERN = next(memory.address for memory in MEMORIES if memory.name == "pattern_mem")
STRIP = Geometry(rows=1, columns=256, clock_hz=48_000_000)
SMALL = Geometry(rows=5, columns=45, lanes=32, clock_hz=4_000_000)
EXPONENTS = range(1, 8)


def board(geometry, **registers):
    system = System(geometry)
    for name, value in ({"tick_clocks": 0} | registers).items():
        system.write(ADDRESS[f"sensor_{name}"], value)
    return system


def frames_of(system, count):
    """Runs `count` frames of a stopped sensor; returns their spikes."""
    period = system.geometry.tick_minimum
    start, place = system.clock, ADDRESS["sensor_run"]
    writes = [(start, place, 1), (start + count * period, place, 0)]
    return rows_of(system.run(count * period + period, writes), system.geometry)


def levels_of(system, exponent):
    """The levels that a stopped sensor reads."""
    size, passes = system.geometry, (1 << exponent) - 1
    tiles = system.run(
        (passes + 1) * size.tick_minimum, [(system.clock, ADDRESS["sensor_reading"], exponent)]
    )
    np.testing.assert_array_equal(np.unique(tiles["frame"]), np.arange(1, passes + 1))
    ones = rows_of(tiles, size).reshape(passes, size.rows, size.columns)
    assert not (ones[1:] & ~ones[:-1]).any()  # a charge below a step is below the next ones
    return ones.sum(axis=0)


@pytest.mark.parametrize("frames", [1, 7, 16])
def test_levels_are_those_of_the_camera_model(frames):
    """Charges of 0 to 4080 electrons under every threshold; at Q and above, the highest level."""
    charge = frames * np.arange(256)
    system = board(STRIP, threshold=15)
    for word in range(64):
        electrons = bytes(range(4 * word, 4 * word + 4))
        system.write(PATTERN + 4 * word, int.from_bytes(electrons, "little"))
    assert not frames_of(system, frames)[:, :255].any()
    for threshold in range(16):
        system.write(ADDRESS["sensor_threshold"], threshold)
        q = quantum(threshold)
        below = charge < q
        for exponent in EXPONENTS:
            levels = 1 << exponent
            got = levels_of(system, exponent)[0]
            np.testing.assert_array_equal(got, np.minimum(levels * charge // q, levels - 1))
            np.testing.assert_array_equal(got[below], quantised(charge[below], q, levels))


@pytest.mark.parametrize("rule", range(3))
def test_a_reading_disturbs_neither_charges_nor_spikes_nor_counts(rule):
    settings = {"pattern": 2, "level": 90, "threshold": 1, "reset_rule": rule}
    window = {"rows": 3 << 16 | 1, "columns": 40 << 16 | 2}
    quiet, read = (board(SMALL, **settings, **window) for _ in range(2))
    period, exponent, at = SMALL.tick_minimum, 3, 11
    passes = (1 << exponent) - 1
    run = (quiet.clock, ADDRESS["sensor_run"], 1)
    request = (read.clock + at * period + period // 2, ADDRESS["sensor_reading"], exponent)
    alone = quiet.run(30 * period + 1, [run])
    tiles = read.run((30 + passes) * period + 1, [run, request])
    scan = (tiles["clock"].astype(np.int64) - int(tiles["clock"][0])) // period
    of_reading = (scan > at) & (scan <= at + passes)
    np.testing.assert_array_equal(tiles["frame"][of_reading], scan[of_reading] - at)
    for name in ("frame", "row", "tile", "bits"):
        np.testing.assert_array_equal(tiles[~of_reading][name], alone[name])
    for name in ("frames", "spikes", "rows_read"):
        assert read.read(ADDRESS[f"sensor_{name}"]) == quiet.read(ADDRESS[f"sensor_{name}"]) > 0
    charge = np.zeros((SMALL.rows, SMALL.columns), np.int64)
    registers = Settings(**(settings | {"rows": (1, 3), "columns": (2, 40)}))
    planes(SMALL, registers, None, at + 1, charge)
    ones = rows_of(tiles[of_reading], SMALL).reshape(passes, 3, SMALL.columns).sum(axis=0)
    np.testing.assert_array_equal(ones, quantised(charge, quantum(1), 8)[1:4])
    assert len(np.unique(ones)) >= 4


def test_a_reading_after_a_clear_is_of_empty_pixels_and_leaves_the_clear_to_the_next_frame():
    system = board(SMALL, pattern=1, level=200, threshold=3)
    frames_of(system, 3)
    assert (levels_of(system, 4) == 16 * 600 // quantum(3)).all()
    system.write(ADDRESS["sensor_clear"], 1)
    assert not levels_of(system, 4).any()
    assert system.read(ADDRESS["sensor_frames"]) == 3
    frames_of(system, 1)
    assert system.read(ADDRESS["sensor_frames"]) == 1
    assert (levels_of(system, 4) == 16 * 200 // quantum(3)).all()


def test_a_request_is_cancelled_and_a_second_one_follows():
    period, place = SMALL.tick_minimum, ADDRESS["sensor_reading"]
    system = board(SMALL, run=1)
    start = system.clock
    tiles = system.run(4 * period, [(start + 5, place, 3), (start + 9, place, 0)])
    assert np.array_equal(np.unique(tiles["frame"]), [0, 1, 2, 3])
    stopped = board(SMALL)
    start = stopped.clock
    tiles = stopped.run(9 * period, [(start, place, 2), (start + period, place, 1)])
    numbers = tiles["frame"][(tiles["row"] == 0) & (tiles["tile"] == 0)]
    np.testing.assert_array_equal(numbers, [1, 2, 3, 1])
