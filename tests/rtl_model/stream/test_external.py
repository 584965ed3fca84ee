"""Pixels in an external memory: the planes of the array in block RAM, at another pace."""

import numpy as np
import pytest

from rtl_model.cycle import Settings, planes
from rtl_model.geometry import Geometry
from rtl_model.stream.external import ExternalArray, Memory, state_words

SIZE = Geometry(rows=5, columns=40, lanes=32)


def scanned(size, settings, electrons, *, pixels, in_flight, latency, ready, clocks, tick=1):
    """The array after `clocks`, its planes, and the clock at which each plane's last tile stood."""
    array = ExternalArray(size, pixels, in_flight)
    memory = Memory(state_words(size, pixels, electrons), latency)
    full = Settings(
        *settings[:3],
        rows=settings.rows or (0, size.rows - 1),
        columns=settings.columns or (0, size.columns - 1),
        pattern=settings.pattern,
        level=settings.level,
    )
    found, ends = {}, {}
    for clock in range(clocks):
        if array.tile is not None:
            frame, row, index, bits = array.tile
            lanes = [bits >> n & 1 for n in range(size.lanes)]
            plane = found.setdefault(frame, np.zeros((size.rows, size.tiles * size.lanes), bool))
            plane[row, index * size.lanes : (index + 1) * size.lanes] = lanes
            ends[frame] = clock
        command, taken = array.command, bool(ready(clock))
        array.edge(True, False, tick, full, memory.arriving, taken)
        memory.edge(command if taken else None)
    shown = [found[n][:, : size.columns] for n in range(len(found) - 1)]
    return array, np.array(shown), ends


@pytest.mark.parametrize("rule", range(4))
@pytest.mark.parametrize("pattern", range(4))
def test_its_planes_are_those_of_the_array_in_block_ram(rule, pattern):
    rng = np.random.default_rng(rule)
    electrons = rng.integers(0, 256, (SIZE.rows, SIZE.columns)).astype(np.uint8)
    for settings in (
        Settings(threshold=1, reset_rule=rule, pattern=pattern, level=200, clock_select=1),
        Settings(
            threshold=0, reset_rule=rule, pattern=pattern, level=77, rows=(1, 3), columns=(3, 38)
        ),
    ):
        _, found, _ = scanned(
            SIZE, settings, electrons, pixels=8, in_flight=8, latency=3,
            ready=lambda clock: rng.random() < 0.9, clocks=800,
        )  # fmt: skip
        assert len(found) > 5
        assert found.any()
        inside = found[:, slice(*_ends(settings.rows))]  # rows outside the window have no tile
        wanted = planes(SIZE, settings, electrons, len(found))
        assert np.array_equal(inside, wanted[:, slice(*_ends(settings.rows))])


def _ends(rows):
    return (0, None) if rows is None else (rows[0], rows[1] + 1)


@pytest.mark.parametrize(("pixels", "latency"), [(1, 1), (2, 4), (4, 9), (8, 12)])
def test_a_plane_takes_two_accesses_a_word(pixels, latency):
    """While enough words are in flight, the memory's port is the limit: N reads, N writes, and the
    way of the last word through memory and pixels, twice a clock of registers each."""
    words = SIZE.pattern_bytes // pixels
    _, _, ends = scanned(
        SIZE, Settings(pattern=1, level=90), np.zeros((SIZE.rows, SIZE.columns), np.uint8),
        pixels=pixels, in_flight=32, latency=latency, ready=lambda clock: True,
        clocks=6 * (2 * words + 100),
    )  # fmt: skip
    periods = set(np.diff(list(ends.values())[:-1]))  # the last one is not over
    assert len(periods) == 1
    assert 2 * words <= periods.pop() <= 2 * words + latency + 6


def test_few_words_in_flight_wait_for_a_slow_memory():
    """W words in flight come round once in a latency and some clocks of the pipeline."""
    words, latency, flight = SIZE.pattern_bytes // 8, 30, 2
    _, _, ends = scanned(
        SIZE, Settings(pattern=1, level=90), np.zeros((SIZE.rows, SIZE.columns), np.uint8),
        pixels=8, in_flight=flight, latency=latency, ready=lambda clock: True, clocks=6000,
    )  # fmt: skip
    period = np.diff(list(ends.values()))[0]
    assert words / flight * latency < period < words / flight * (latency + 8)


@pytest.mark.parametrize("tick", [300, 1000])
def test_a_frame_that_is_due_too_early_begins_late_and_is_counted(tick):
    words = SIZE.pattern_bytes // 2
    array, _, ends = scanned(
        SIZE, Settings(pattern=1, level=90), np.zeros((SIZE.rows, SIZE.columns), np.uint8),
        pixels=2, in_flight=8, latency=2, ready=lambda clock: True, clocks=5000, tick=tick,
    )  # fmt: skip
    on_time = 2 * words + 10 < tick
    assert array.late == (0 if on_time else array.frames - 1)
    if on_time:
        assert set(np.diff(list(ends.values())[:-1])) == {tick}
