"""Verilog and cycle model agree to the bit and the clock under all writes."""

import numpy as np
import pytest

from rtl_model import lockstep
from rtl_model.verilated.build import missing
from tests.rtl_model.lockstep.bright import BRIGHT, FRAMES, HELD

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")

SMALL = lockstep.Program(rows=20, columns=40, lanes=32, seed=1)
WIDE = lockstep.Program(rows=12, columns=1000, lanes=64, seed=3)


def covered(outcome, windows):
    """Checks that the comparison has covered everything."""
    coverage = outcome.coverage
    assert outcome.difference is None, str(outcome.difference)
    assert coverage.pixels.sum() == outcome.pixels
    for axis in range(4):  # threshold, reset rule, pattern, clock
        rest = tuple(other for other in range(4) if other != axis)
        assert (coverage.pixels.sum(rest) > outcome.pixels // 1000).all()
    assert (coverage.pixels.sum((1, 2)) > 0).all()  # each threshold at both clocks
    assert set(coverage.windows) >= windows
    assert 0.001 * outcome.pixels < coverage.spikes < outcome.pixels
    assert (
        min(coverage.bursts, coverage.sink_tiles, coverage.reads // 50, coverage.writes // 50) > 10
    )


WINDOWS = {"whole", "one pixel", "partly-filled tile", "one tile", "part", "no column"}


def test_two_geometries_over_a_hundred_million_pixel_cycles():
    assert SMALL.columns % SMALL.lanes
    assert WIDE.columns % WIDE.lanes
    for program, pixels in ((SMALL, 2e6), (WIDE, 1e8)):
        outcome = lockstep.run(program, pixels=pixels)
        covered(outcome, WINDOWS)
        assert outcome.pixels >= pixels


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "pixels"),
    [
        (lockstep.Program(rows=32, columns=32, lanes=32, seed=11), 5e7),
        (lockstep.Program(rows=64, columns=70, lanes=64, seed=12), 1e8),
        (lockstep.Program(rows=5, columns=2000, lanes=64, seed=13), 5e8),
        (lockstep.Program(rows=7, columns=301, lanes=32, seed=14), 1e8),
        (WIDE, 3e8),
    ],
)
def test_a_thousand_million_pixel_cycles(program, pixels):
    windows = WINDOWS if program.columns % program.lanes else WINDOWS - {"partly-filled tile"}
    if program.columns <= program.lanes:
        windows = windows - {"part"}  # any part of such a row is one tile
    covered(lockstep.run(program, pixels=pixels), windows)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("rows", "columns", "lanes"), [(1, 1, 32), (3, 33, 32), (2, 64, 64)])
def test_small_arrays(rows, columns, lanes, seed):
    program = lockstep.Program(rows=rows, columns=columns, lanes=lanes, seed=seed)
    outcome = lockstep.run(program, pixels=5e5 if columns > 1 else 1e4)
    assert outcome.difference is None, str(outcome.difference)


def test_a_charge_saturates():
    outcome = lockstep.run(BRIGHT, pixels=BRIGHT.pixels)
    assert outcome.difference is None, str(outcome.difference)
    assert outcome.pixels == BRIGHT.pixels
    assert outcome.coverage.spikes == BRIGHT.rows * BRIGHT.columns * (FRAMES + HELD)


def test_a_run_ends_at_its_clock_and_reports_its_progress():
    reports = []
    outcome = lockstep.run(SMALL, until=30_001, progress=lambda *so_far: reports.append(so_far))
    assert outcome.clock <= 30_001
    assert outcome.difference is None
    clocks, pixels = np.array(reports).T
    assert (np.diff(clocks) > 0).all()
    assert (np.diff(pixels) >= 0).all()

    def stop(clock, pixels):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lockstep.run(SMALL, progress=stop)


def test_a_program_is_a_function_of_its_seed():
    first, again = (SMALL.chunk(5, 100) for _ in range(2))
    assert first == again
    assert lockstep.Program(20, 40, 32, seed=2).chunk(5, 100) != first
    for program, chunks in ((SMALL, 60), (lockstep.Program(1, 1, 32, seed=1), 300)):
        for number in range(chunks):
            chunk = program.chunk(number, 100)
            assert all(100 <= write.clock < chunk.stop for write in chunk.writes)
    clocks = [write.clock for write in first.writes]
    assert clocks == sorted(set(clocks))
    assert all(100 <= clock < first.stop for clock in clocks)
