"""The front end of a sensor: alignment, its loss, skew, and rows with errors."""

import numpy as np
import pytest

from rtl_model.geometry import Geometry
from rtl_model.stream.lines import (
    FIND,
    LOSE,
    MARKER,
    SKEW,
    TRAINING,
    Lane,
    Lines,
    check_word,
    disturbed,
    lane_words,
)

SIZE = Geometry(rows=5, columns=70, lanes=32)
WIRES = SIZE.lanes // 8
ROW = SIZE.tiles + 5  # words of a row with its marker
PAUSE, TRAIN = 30, 60


def rotations(word):
    return [(word << n | word >> 8 - n) & 0xFF for n in range(8)]


def planes_of(count, first=0):
    rng = np.random.default_rng(3)
    return {first + n: rng.random((SIZE.rows, SIZE.columns)) < 0.4 for n in range(count)}


def sent(planes, pause):
    """Words of all lanes, with a pause at the end in which the last row leaves."""
    words = lane_words(planes, SIZE, training=TRAIN, pause=pause)
    return np.concatenate([words, np.full((20, WIRES), TRAINING, np.uint8)])


def received(words):
    """The front end after all words, and the rows that left: {(plane, row): spikes}."""
    lines, found = Lines(SIZE), {}
    for bits in words.tolist():
        if lines.tile is not None:
            frame, row, index, tile = lines.tile
            spikes = [bool(tile >> n & 1) for n in range(SIZE.lanes)]
            found.setdefault((frame, row), {})[index] = spikes
        lines.edge(bits)
    rows = {key: np.concatenate([tiles[n] for n in sorted(tiles)]) for key, tiles in found.items()}
    return lines, {key: row[: SIZE.columns] for key, row in rows.items()}


def assert_right(found, planes):
    assert all(np.array_equal(row, planes[plane][n]) for (plane, n), row in found.items())


def test_words_of_pause_and_row_are_four_bits_apart():
    words = rotations(TRAINING)
    distances = [(a ^ b).bit_count() for n, a in enumerate(words) for b in words[:n]]
    assert min(distances) == 4
    assert min((MARKER ^ word).bit_count() for word in words) == 4


def test_one_and_two_wrong_bits_of_a_row_change_its_check_word():
    rng = np.random.default_rng(1)
    row = rng.integers(0, 256, 8).astype(np.uint8)
    bits = np.unpackbits(row)
    good = check_word(row)
    for first in range(bits.size):
        for second in range(first, bits.size):
            wrong = bits.copy()
            wrong[[first, second]] ^= 1
            assert check_word(np.packbits(wrong)) != good


@pytest.mark.parametrize("offset", range(8))
def test_a_lane_finds_each_boundary_in_closed_form(offset):
    """The empty registers are the first wrong word, so boundary 0 is found after all others. A slip
    takes two clocks."""
    lane = Lane(ROW - 1)
    words = disturbed(np.full(60, TRAINING, np.uint8), slips=[(0, offset)])
    clocks = 0
    while not lane.aligned:
        lane.edge(int(words[clocks]))
        clocks += 1
    assert clocks == 2 * (offset or 8) + FIND
    assert lane.word == TRAINING


@pytest.mark.parametrize(
    "skews", [(0, 0, 0, 0), (1, 6, 0, 3), (0, 8 * SKEW, 5, 11), (7, 7 + 8 * SKEW, 20, 8)]
)
def test_every_row_arrives_whatever_the_skew(skews):
    planes = planes_of(4, first=4094)
    words = sent(planes, 4)
    for wire, skew in enumerate(skews):
        words[:, wire] = disturbed(words[:, wire], slips=[(0, skew)])
    lines, found = received(words)
    assert (lines.losses, lines.bad_rows, lines.missed_rows) == (0, 0, 0)
    assert list(found) == [(n, row) for n in planes for row in range(SIZE.rows)]
    assert_right(found, planes)


@pytest.mark.parametrize("place", [(1, 2), (3, 0), (4, 7), (ROW - 1, 5)])
def test_a_wrong_bit_in_a_row_costs_that_row(place):
    """In the head, the bits, or the check word; a wrong marker is a row that lacks a lane."""
    planes = planes_of(3)
    words = sent(planes, PAUSE)
    begin = TRAIN + 7 * (ROW + PAUSE)  # plane 1, row 2
    words[begin + place[0], 2] ^= 1 << place[1]
    lines, found = received(words)
    assert set(planes) == {plane for plane, _ in found}
    assert len(found) == 3 * SIZE.rows - 1
    assert (1, 2) not in found
    assert (lines.losses, lines.bad_rows, lines.missed_rows) == (0, 1, 0)
    assert_right(found, planes)


def test_a_wrong_marker_is_a_row_without_a_lane():
    planes = planes_of(3)
    words = sent(planes, PAUSE)
    words[TRAIN + 8 * (ROW + PAUSE), 2] ^= 16  # plane 1, row 3
    lines, found = received(words)
    assert (lines.bad_rows, lines.missed_rows) == (0, 1)
    # The lane takes the row for wrong words of a pause: it loses its place, and finds it again.
    assert lines.losses == 1
    assert (1, 3) not in found
    assert len(found) >= 3 * SIZE.rows - 2
    assert_right(found, planes)


def test_wrong_bits_in_pauses_cost_nothing():
    planes = planes_of(3)
    words = sent(planes, PAUSE)
    for n in range(3 * SIZE.rows):
        for wire in range(WIRES):
            for place in (6, 12, 25):
                words[TRAIN + n * (ROW + PAUSE) + ROW + place, wire] ^= 1 << n % 8
    lines, found = received(words)
    assert (lines.losses, lines.bad_rows, lines.missed_rows) == (0, 0, 0)
    assert len(found) == 3 * SIZE.rows
    assert_right(found, planes)


@pytest.mark.parametrize("count", [-3, -1, 1, 2, 4, 7])
def test_a_slip_loses_the_alignment_once_and_two_rows_at_most(count):
    planes = planes_of(6)
    words = sent(planes, PAUSE)
    clean = words.copy()
    slip_at = TRAIN + 8 * (ROW + PAUSE) + 4  # in the bits of plane 1, row 3
    words[:, 1] = disturbed(words[:, 1], slips=[(8 * slip_at, count)])
    lines, found = received(words)
    lost = {(n, row) for n in planes for row in range(SIZE.rows)} - set(found)
    assert lines.losses == 1
    assert all(lane.aligned for lane in lines.lanes)
    assert (1, 3) in lost <= {(1, 3), (1, 4)}
    assert_right(found, planes)
    assert PAUSE >= LOSE + 2 * 8 + FIND + 2  # so the pause after the row is enough
    assert received(clean)[0].losses == 0


def test_a_dead_lane_is_told():
    planes = planes_of(4)
    words = sent(planes, PAUSE)
    words[TRAIN + ROW + 5 :, 3] = 0xFF
    lines, found = received(words)
    assert set(found) == {(0, 0)}
    assert lines.losses == 1
    assert [lane.aligned for lane in lines.lanes] == [True, True, True, False]
    assert lines.missed_rows == 4 * SIZE.rows - 1
