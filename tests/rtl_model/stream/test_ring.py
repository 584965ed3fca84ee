"""The ring buffer of the stream: what a reader gets, and what it knows of losses."""

import numpy as np
import pytest

from cosim import InputError
from rtl_model.cycle import Settings, System, planes
from rtl_model.geometry import Geometry
from rtl_model.lockstep.program import ADDRESS
from rtl_model.stream.ring import Beat, Ring, Tile
from tests.rtl_model.stream.reader import read_stream

SIZE = Geometry(rows=6, columns=70, lanes=32, clock_hz=4_000_000)
FRAMES = 40
SETTINGS = {"sensor_pattern": 2, "sensor_level": 40, "sensor_threshold": 1, "sensor_run": 1}


@pytest.fixture(scope="module")
def truth():
    """The planes of a ramp, (FRAMES, rows, columns) bool."""
    return planes(SIZE, Settings(threshold=1, pattern=2, level=40), None, FRAMES)


@pytest.fixture(scope="module")
def tiles():
    """The tiles of the same planes by the clock at which they stand at the pins."""
    writes = [(n, ADDRESS[name], value) for n, (name, value) in enumerate(SETTINGS.items())]
    found = System(SIZE).run(4 + FRAMES * SIZE.tick_clocks, writes)
    assert len(found) == FRAMES * SIZE.rows * SIZE.tiles
    fields = ("frame", "row", "tile", "bits")
    return {int(t["clock"]) + 1: Tile(*(int(t[name]) for name in fields)) for t in found}


def streamed(tiles, depth, ready):
    """The ring after all tiles, and the beats that it passed on; `ready` by clock."""
    ring, beats = Ring(SIZE.tiles, depth), []
    for clock in range(max(tiles) + 3):
        free = bool(ready(clock))
        if ring.beat is not None and free:
            beats.append(ring.beat)
        ring.edge(tiles.get(clock), free)
    while ring.beat is not None:
        beats.append(ring.beat)
        ring.edge(None, True)
    return ring, beats


def test_a_reader_that_keeps_up_gets_every_plane(tiles, truth):
    ring, beats = streamed(tiles, 8, lambda clock: True)
    found = read_stream(beats, SIZE)
    assert (ring.lost_planes, ring.lost_rows) == (0, 0)
    assert len(beats) == FRAMES * SIZE.rows * (SIZE.tiles + 1)
    assert np.array_equal(np.array(list(found.planes.values())), truth)
    assert list(found.planes) == list(range(FRAMES))
    assert not found.incomplete | found.missing
    assert sum(beat.user == 1 for beat in beats) == FRAMES
    assert sum(beat.last for beat in beats) == FRAMES * SIZE.rows


@pytest.mark.parametrize("depth", [4, 16, 64])
def test_what_a_blocked_reader_loses_is_counted_in_closed_form(depth, tiles):
    """The ring takes rows until one does not fit, of which the first has one beat at the output."""
    ring, beats = streamed(tiles, depth, lambda clock: False)
    rows = (depth + 1) // (SIZE.tiles + 1)
    assert len(beats) == rows * (SIZE.tiles + 1)
    assert ring.lost_rows == FRAMES * SIZE.rows - rows
    assert ring.lost_planes == FRAMES - rows // SIZE.rows


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("depth", [4, 32, 256])
def test_a_slow_reader_knows_which_planes_are_lost(share, depth, tiles, truth):
    rng = np.random.default_rng(depth)
    pauses = np.repeat(rng.random(500) < share, 200)
    ring, beats = streamed(tiles, depth, lambda clock: pauses[clock])
    found = read_stream(beats, SIZE)
    last = max(found.planes)
    known = found.incomplete | found.missing
    whole = {n for n, rows in found.rows.items() if len(rows) == SIZE.rows}
    assert whole - {last} == set(found.planes) - known - {last}
    # The last plane may be cut, and later ones lost, without a head that would tell.
    assert ring.lost_planes == len(known) + (last not in whole) + FRAMES - 1 - last
    for number, rows in found.rows.items():
        assert rows == list(range(len(rows)))
        assert np.array_equal(found.planes[number][rows], truth[number][rows])
    assert whole or depth == 4
    assert known or (share, depth) == (0.5, 256)


def test_a_window_and_a_clear_open_planes_of_one_number():
    ring, beats = Ring(1, 8), []
    for clock in range(40):
        tile = Tile(0, 3, 0, clock) if clock % 4 == 0 else None  # one row a plane, all number 0
        if ring.beat is not None:
            beats.append(ring.beat)
        ring.edge(tile, True)
    heads = beats[::2]
    assert {(head.data, head.user) for head in heads} == {(3, 1)}
    assert [beat.data for beat in beats[1::2]] == list(range(0, 4 * len(beats[1::2]), 4))


def test_beats_that_are_no_rows_are_refused_in_one_line(tiles):
    _, beats = streamed(tiles, 64, lambda clock: True)
    cases = {
        "a later row of plane": beats[4:],
        "the end of a row after 3 tiles": [*beats[:3], *beats[4:]],
        "a head of a row below 6": [Beat(7, False, 1)],
        "a plane after number 39": [*beats, *beats],
        "a first plane with none before it": [beats[0]._replace(user=3), *beats[1:]],
    }
    for words, wrong in cases.items():
        with pytest.raises(InputError, match=words):
            read_stream(wrong, SIZE)


def test_numbers_go_on_beyond_twenty_bits():
    ring, beats = Ring(1, 8), []
    for n in range(3):
        for tile in (Tile((1 << 20) - 2 + 2 * n, 0, 0, 1), None, None, None, None):
            if ring.beat is not None:
                beats.append(ring.beat)
            ring.edge(tile, True)
    found = read_stream(beats, Geometry(1, 32))
    assert list(found.planes) == [(1 << 20) - 2 + 2 * n for n in range(3)]
    assert found.missing == {(1 << 20) - 1, (1 << 20) + 1}
