"""What the panel shows: training, pilots, groups, tags; planes as words; all of it read back."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Clock
from cosim.spikes.viform import unpack_planes
from link.coding import Inbox
from link.layout import PERIOD, TRAINING, Layout, pilots, training
from link.mode import CELLS, LINE_CODES, TICKS, Mode
from link.sending import FileTransmission, PlaneStream, Transmission

DATA = np.random.default_rng(1).bytes(9000)


def sending(line="8b10b", cell=2, ticks=2, **kept) -> Transmission:
    mode = Mode(192, 160, cell, ticks, line, 32)
    return FileTransmission(mode, DATA, "a.bin", **kept)


@pytest.mark.parametrize("line", LINE_CODES)
@pytest.mark.parametrize("interleave", [True, False])
def test_the_planes_alone_bring_the_file_back(line, interleave):
    """Read from the words of a panel: tags, cells and pilots are where the layout says."""
    sent = sending(line, interleave=interleave)
    layout, side, ticks = sent.layout, sent.mode.cell, sent.ticks
    planes = unpack_planes(sent.words(0, sent.planes), 0, sent.planes).astype(bool)
    assert sent.data_end == TRAINING + sent.outbox.groups * layout.group
    assert len(planes) == sent.planes == (sent.data_end + layout.closing) * ticks
    symbols = planes.reshape(-1, ticks, *planes.shape[1:])
    assert (symbols == symbols[:, :1]).all()
    cells = symbols[:, 0, ::side, ::side].reshape(sent.symbols, -1)
    assert (cells[:TRAINING, layout.data] == training(layout)).all()
    known = pilots()[np.arange(sent.symbols) % PERIOD]
    assert (cells[:, layout.pilot.ravel()] == known[:, None]).all()
    assert (cells[sent.data_end :, layout.data] == training(layout)[: layout.closing]).all()
    shown = cells[TRAINING : sent.data_end, layout.data]
    soft = np.where(shown, 2, -2).astype(np.float32)
    inbox = Inbox(layout, interleave=interleave)
    for group, part in enumerate(soft.reshape(-1, layout.group, layout.cells)):
        inbox.put(group, part)
    assert inbox.file is not None
    assert (inbox.file.data, inbox.file.name) == (DATA, "a.bin")


def test_scrambled_symbols_have_random_training_and_few_pilots():
    old, new = (Layout(Mode(960, 960, 2, 1, line, 16)) for line in ("none", "scrambled"))
    assert (old.mode.format, new.mode.format) == (1, 2)
    assert (old.pilot_columns.size, new.pilot_columns.size) == (15, 5)
    assert Mode.from_tags(new.mode.tags) == new.mode
    before, after = (training(layout).astype(float) for layout in (old, new))
    assert (before[::2] + before[1::2] == 1).all()
    # Successive bits of a cell are independent: the correlation of 2.2e5 cells is within 5 sigma.
    some = after[:, :200_000] - 0.5
    for lag in (1, 2, 24):
        assert abs(4 * (some[lag:] * some[:-lag]).mean()) < 5 / np.sqrt(some[lag:].size)
    assert abs(some.mean()) < 2.5 / np.sqrt(some.size)


@pytest.mark.parametrize("cell", CELLS)
def test_cells_fill_their_pixels(cell):
    sent = sending(cell=cell)
    rows, columns = sent.layout.shape
    shown, cells = sent.pixels(50), sent.cells(50, 1)[0]
    blocks = shown[: rows * cell, : columns * cell].reshape(rows, cell, columns, cell)
    lit = sent.layout.free[:, None, :, None]
    assert (blocks == cells[:, None, :, None])[np.broadcast_to(lit, blocks.shape)].all()
    assert (
        cells[sent.layout.data // columns, sent.layout.data % columns] == sent.bits(50, 1)
    ).all()
    assert not cells[~sent.layout.free].any()


@pytest.mark.parametrize("ticks", TICKS)
def test_any_stretch_of_words_is_that_stretch_of_planes(ticks):
    sent = sending(ticks=ticks)
    whole = unpack_planes(sent.words(0, sent.planes), 0, sent.planes)
    for first, count in ((0, 1), (5, 70), (sent.planes - 3, 3), (33, 32)):
        part = unpack_planes(sent.words(first, count), 0, count)
        assert (part == whole[first : first + count]).all()
    for symbol in (0, TRAINING, sent.symbols - 1):
        assert (sent.pixels(symbol) == whole[symbol * ticks + ticks - 1]).all()
    after = sent.words(sent.planes - 2, 40)
    assert after.shape[0] == 2 and not (after[0] >> np.uint32(2)).any() and not after[1].any()


def test_symbols_may_be_asked_for_in_any_order():
    """The running disparity of each cell is that of the groups before, asked for or not."""
    one, two = sending(), sending()
    whole = one.bits(0, one.symbols)
    last = two.bits(two.symbols - 3, 3)
    assert (last == whole[-3:]).all()
    assert (two.bits(TRAINING + 4, 20) == whole[TRAINING + 4 : TRAINING + 24]).all()


def test_tags_are_found_and_tell_the_mode():
    mode = Mode(384, 352, 3, 4, "4b6b", 64)
    sent = FileTransmission(mode, b"x", "x")
    mean = np.mean([sent.pixels(n) for n in range(0, 54, 4)], axis=0) * 255
    picture = cv2.copyMakeBorder(mean.astype(np.uint8), 20, 20, 20, 20, cv2.BORDER_CONSTANT)
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    corners, ids, _ = cv2.aruco.ArucoDetector(family).detectMarkers(picture)
    places = {
        int(n): corner[0].mean(axis=0) - 20 for n, corner in zip(ids.ravel(), corners, strict=True)
    }
    assert Mode.from_tags(tuple(sorted(places, key=lambda n: n % 4))) == mode
    half = sent.layout.tag / 2
    for tag, x, y in zip(
        mode.tags, (half, 384 - half, 384 - half, half), (half, half, 352 - half, 352 - half),
        strict=True,
    ):  # fmt: skip
        assert np.allclose(places[tag], (x - 0.5, y - 0.5), atol=0.6)


def test_what_does_not_fit_is_cut_off():
    whole = FileTransmission(Mode(192, 160, 2, 2, "8b10b", 32), bytes(20_000), "x")
    assert whole.sent_whole and whole.groups == whole.outbox.groups
    for most in (1, TRAINING, TRAINING + 15, whole.symbols - 1, whole.symbols + 1):
        cut = FileTransmission(whole.mode, bytes(20_000), "x", most_symbols=most)
        assert cut.symbols == min(most, whole.symbols) and cut.planes == 2 * cut.symbols
        assert cut.groups == max(cut.symbols - TRAINING, 0) // 10
        carried = cut.outbox.frames_by(cut.groups)
        assert cut.sent_whole == (carried >= cut.outbox.frames_needed)
    cut = FileTransmission(whole.mode, bytes(20_000), "x", most_symbols=TRAINING + 15)
    assert not cut.sent_whole
    with pytest.raises(ValueError, match="most_symbols must be 1 or more"):
        FileTransmission(whole.mode, b"", "x", most_symbols=0)


def test_what_cannot_be_asked_for():
    sent = sending()
    for first, count in ((-1, 1), (0, sent.symbols + 1), (sent.symbols, 1)):
        with pytest.raises(ValueError, match="symbols must be within 0 to"):
            sent.bits(first, count)
    with pytest.raises(ValueError, match="planes must be 0 or more"):
        sent.words(-1, 1)


@settings(max_examples=15)
@given(st.data())
def test_a_stream_of_planes_gives_the_words_that_it_is_asked_for(data):
    sent = sending(ticks=3)
    stream = PlaneStream(sent, Clock(40_000))
    assert stream.shape == (160, 192) and stream.cycles == sent.planes
    last = -(-stream.cycles // 32)
    first = data.draw(st.integers(0, last))
    stop = data.draw(st.integers(first, last + 2))
    words = stream.read_words(first, stop)
    assert len(words) == max(min(stop, last) - first, 0)
    assert (words == sent.words(0, sent.planes)[first:stop]).all()
