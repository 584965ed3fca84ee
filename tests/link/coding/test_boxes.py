"""From a file to values and back: whole, with losses, with damage, and with what is no file."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from link.coding import Blocks, Inbox, Outbox
from link.layout import Layout
from link.line_codes import CATALOGUE, encode_line
from link.mode import LINE_CODES, PARITIES, Mode
from tests.link.coding.soft import soft_of

SMALL = Layout(Mode(256, 224, 2, 1, "8b10b", 32))


def bytes_of(size: int, seed: int = 1) -> bytes:
    return np.random.default_rng(seed).bytes(size)


def full(layout: Layout, blocks: int, spare: int = 0) -> bytes:
    """A file that leaves `spare` frames of so many blocks."""
    form = Blocks(layout)
    return bytes_of((blocks * form.frames - spare) * form.symbol_bytes - 60)


def all_values(outbox: Outbox) -> np.ndarray:
    return np.stack([outbox.values(group) for group in range(outbox.groups)])


def put_all(inbox: Inbox, values: np.ndarray, quality: np.ndarray | None = None) -> None:
    for group, row in enumerate(values):
        sure = 9.0 if quality is None else quality[group]
        inbox.put(group, soft_of(inbox.layout, row, sure))


@pytest.mark.parametrize("line", LINE_CODES)
@pytest.mark.parametrize("parity", PARITIES)
@pytest.mark.parametrize("interleave", [True, False])
@pytest.mark.parametrize("size", [0, 1, 100])
def test_a_noiseless_round_trip_is_bit_exact(line, parity, interleave, size):
    """On a panel whose group of cells holds less than a codeword for most line codes."""
    layout = Layout(Mode(128, 160, 4, 1, line, parity))
    data = bytes_of(size)
    outbox = Outbox(data, "../a b.bin", layout, interleave=interleave)
    shown = encode_line(line, all_values(outbox))
    soft = np.where(shown, 3, -3).astype(np.float32)
    inbox = Inbox(layout, interleave=interleave)
    for group in range(outbox.groups):
        inbox.put(group, soft[group * layout.group : (group + 1) * layout.group])
    assert inbox.file is not None
    assert (inbox.file.data, inbox.file.name) == (data, "a b.bin")
    assert inbox.frames_right == inbox.frames_read == outbox.frames
    assert inbox.frames_needed == outbox.frames_needed
    assert inbox.codewords_wrong == inbox.bytes_corrected == 0 and not inbox.cell_errors.any()


@pytest.mark.parametrize("line", LINE_CODES)
@pytest.mark.parametrize("interleave", [True, False])
def test_a_hundred_kilobytes(line, interleave):
    layout = Layout(Mode(512, 512, 2, 1, line, 32))
    data = bytes_of(100_000)
    outbox = Outbox(data, "x", layout, interleave=interleave)
    inbox = Inbox(layout, interleave=interleave)
    put_all(inbox, all_values(outbox))
    assert inbox.file is not None and inbox.file.data == data
    blocks = Blocks(layout, interleave)
    carried = 8 * blocks.frames * blocks.symbol_bytes
    share = carried / (blocks.groups * layout.cells * CATALOGUE[line].bits)
    assert 0.9 * 223 / 255 < share < 223 / 255  # of the line code's bits: little else is spent


def test_the_same_bytes_are_sent_every_time():
    one, two = (all_values(Outbox(bytes_of(5000), "x", SMALL)) for _ in range(2))
    assert (one == two).all()
    assert (one != all_values(Outbox(bytes_of(5000), "y", SMALL))).any()


@pytest.mark.parametrize("line", LINE_CODES)
def test_an_empty_payload_lights_half_of_the_cells(line):
    """Zeros, whose codewords are zeros: the scrambler makes coins of them."""
    layout = Layout(Mode(256, 256, 2, 1, line, 32))
    shown = encode_line(line, all_values(Outbox(bytes(20_000), "x", layout)))
    cells = shown.mean(axis=0)
    odd = 1 / len(shown) if line == "8b10b" else 0  # lanes begin at -1 and end at either
    assert abs(shown.mean() - 0.5) < 5 * 0.5 / np.sqrt(shown.size) + odd
    assert cells.std() < 5 * 0.5 / np.sqrt(len(shown))


def test_lost_groups_are_made_good_by_the_fountain():
    data = full(SMALL, 6, spare=2)
    outbox = Outbox(data, "x", SMALL, overhead=0.3)
    values = all_values(outbox)
    lost = {0, 3}
    assert len(values) == 8  # six of which, less two frames, are the file
    inbox = Inbox(SMALL)
    for group in reversed(range(len(values))):  # in any order
        if group not in lost:
            inbox.put(group, soft_of(SMALL, values[group]))
    assert inbox.file is not None and inbox.file.data == data
    assert inbox.frames_right < outbox.frames


def test_too_few_frames_deliver_nothing():
    outbox = Outbox(bytes_of(60_000), "x", SMALL)
    values = all_values(outbox)
    inbox = Inbox(SMALL)
    put_all(inbox, values[: len(values) // 2])
    assert inbox.file is None
    assert 0 < inbox.frames_right < inbox.frames_needed == outbox.frames_needed


def chance(rows: int, seed: int = 11) -> np.ndarray:
    """What a panel shows that sends no file."""
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, (rows, SMALL.cells)).astype(np.uint8)


@pytest.mark.parametrize("after", ["chance", "another file"])
def test_frames_are_counted_to_the_end_of_the_file_that_is_whole(after):
    data = full(SMALL, 3, spare=2)
    outbox = Outbox(data, "x", SMALL, overhead=0.7)  # of five blocks three are needed
    values = all_values(outbox)
    assert len(values) == 5
    more = chance(4) if after == "chance" else all_values(Outbox(bytes_of(60_000, 9), "y", SMALL))
    inbox = Inbox(SMALL)
    put_all(inbox, values)
    assert inbox.file is not None and inbox.file.data == data and not inbox.over
    mended = inbox.codewords
    put_all(inbox, more)
    assert inbox.over
    assert inbox.frames_read == inbox.frames_right == outbox.frames
    assert inbox.codewords == mended and inbox.codewords_wrong == 0


def test_frames_of_the_file_that_are_lost_once_it_is_whole_are_counted():
    """As long as some of a block are right the transmission goes on, and errors are its own."""
    outbox = Outbox(full(SMALL, 3, spare=2), "x", SMALL, overhead=0.7, interleave=False)
    values = all_values(outbox)
    half = slice(0, SMALL.cells // 2)
    values[4, half] = chance(1)[0, half]
    inbox = Inbox(SMALL, interleave=False)
    put_all(inbox, values)
    assert inbox.file is not None and not inbox.over
    assert inbox.frames_read == outbox.frames
    lost = inbox.frames_read - inbox.frames_right
    assert 0.4 < lost / Blocks(SMALL, False).frames < 0.7


def test_frames_are_lost_as_long_as_the_file_is_not_whole():
    outbox = Outbox(full(SMALL, 3, spare=2), "x", SMALL, overhead=0.3)
    values = all_values(outbox)
    inbox = Inbox(SMALL)
    put_all(inbox, np.concatenate([values[:2], chance(2)]))
    assert inbox.file is None and not inbox.over
    assert inbox.frames_read == 2 * inbox.frames_right


@pytest.mark.parametrize("seen", [True, False])
def test_a_burst_is_survived_with_the_interleaver_alone(seen):
    """Neighbouring cells, 8 % of the panel, show chance: hidden where seen to be (quality 0), else
    unknown. A codeword has 20 of them in its 255 bytes with the interleaver, or all or none."""
    data = full(SMALL, 5, spare=2)
    rng = np.random.default_rng(3)
    share = 0.08 if seen else 0.04
    delivered, lost = {}, {}
    for interleave in (True, False):
        outbox = Outbox(data, "x", SMALL, interleave=interleave, overhead=0)
        values = all_values(outbox)
        bad = slice(SMALL.cells // 3, SMALL.cells // 3 + int(share * SMALL.cells))
        values[:, bad] = rng.integers(0, 256, values[:, bad].shape)
        quality = np.full(values.shape, 9, np.float32)
        quality[:, bad] = 0 if seen else 9
        inbox = Inbox(SMALL, interleave=interleave)
        put_all(inbox, values, quality)
        delivered[interleave] = inbox.file is not None and inbox.file.data == data
        lost[interleave] = 1 - inbox.frames_right / inbox.frames_read
        if interleave:  # the map of cells shows where
            assert inbox.cell_errors[bad].mean() > 0.9 * len(values)
            assert inbox.cell_errors.sum() == inbox.cell_errors[bad].sum()
    assert delivered == {True: True, False: False}
    assert lost[True] == 0 and lost[False] > share / 2


def test_erasures_mend_what_errors_alone_cannot():
    """24 bad bytes of 255 in every codeword, with parity 32: more than 16, fewer than 32."""
    outbox = Outbox(bytes_of(3000), "x", SMALL)
    values = all_values(outbox)
    blocks = Blocks(SMALL)
    rng = np.random.default_rng(4)
    quality = np.full(values.shape, 9, np.float32)
    for row, sure in zip(values, quality, strict=True):
        for places in blocks.places:
            bad = rng.choice(places, 24, replace=False)
            row[bad] ^= rng.integers(1, 256, 24, dtype=np.uint8)
            sure[bad] = rng.random(24)
    seen, blind = Inbox(SMALL), Inbox(SMALL)
    put_all(seen, values, quality)
    put_all(blind, values)
    assert seen.file is not None and seen.codewords_wrong == 0
    assert seen.bytes_corrected == 24 * seen.codewords
    assert blind.file is None and blind.codewords_wrong == blind.codewords


@pytest.mark.parametrize(
    ("line", "enough"), [("manchester", True), ("4b6b", True), ("none", False)]
)
def test_a_block_of_several_groups_is_read_without_one(line, enough):
    """Which is a tenth of a codeword, a third of it, or nine tenths; half of it is parity."""
    layout = Layout(Mode(128, 128, 6, 1, line, 128))
    blocks = Blocks(layout)
    assert blocks.groups > 1
    outbox = Outbox(b"hello", "x", layout)
    values = all_values(outbox)
    inbox = Inbox(layout)
    brought = [inbox.put(n, soft_of(layout, values[n])) for n in range(1, blocks.groups)]
    assert not any(brought) and inbox.file is None
    inbox.flush()
    assert (inbox.file is not None) == enough
    assert inbox.flush() == 0


def test_two_files_in_one_stream_are_not_mixed():
    first, second = bytes_of(30_000, 5), bytes_of(30_000, 6)
    one, two = (all_values(Outbox(d, "x", SMALL)) for d in (first, second))
    inbox = Inbox(SMALL)
    put_all(inbox, one[:2])
    put_all(inbox, two)
    assert inbox.file is not None and inbox.file.data == second


def test_another_layout_or_interleaver_delivers_nothing():
    values = all_values(Outbox(bytes_of(2000), "x", SMALL))
    for other, interleave in ((SMALL, False), (Layout(Mode(256, 224, 2, 1, "8b10b", 64)), True)):
        inbox = Inbox(other, interleave=interleave)
        put_all(inbox, values)
        assert inbox.file is None and inbox.frames_right == 0
        assert inbox.codewords_wrong == inbox.codewords > 0


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.02, 0.1, 0.3, 1.0]))
def test_damage_never_delivers_a_wrong_file(seed, share):
    """Cells of any value and any quality, groups in any order, repeated or lost."""
    rng = np.random.default_rng(seed)
    data = rng.bytes(int(rng.integers(0, 8000)))
    outbox = Outbox(data, "x", SMALL)
    values, inbox = all_values(outbox), Inbox(SMALL)
    for group in rng.integers(0, outbox.groups + 2, outbox.groups + 3):
        row = values[group].copy() if group < outbox.groups else np.zeros(SMALL.cells, np.uint8)
        bad = rng.random(SMALL.cells) < share
        row[bad] = rng.integers(0, 256, int(bad.sum()))
        quality = rng.choice([0, 1, np.nan, np.inf], SMALL.cells).astype(np.float32)
        inbox.put(int(group), soft_of(SMALL, row, quality))
    assert inbox.file is None or (inbox.file.data, inbox.file.name) == (data, "x")
    assert 0 <= inbox.frames_right <= inbox.frames_read
    assert 0 <= inbox.codewords_wrong <= inbox.codewords


def test_what_cannot_be():
    with pytest.raises(ValueError, match="overhead must be 0 or more"):
        Outbox(b"", "x", SMALL, overhead=-1)
    with pytest.raises(ValueError, match="group must be from 0 to"):
        Outbox(b"", "x", SMALL).values(10**6)
    inbox = Inbox(SMALL)
    with pytest.raises(ValueError, match="soft must be"):
        inbox.put(0, np.zeros((SMALL.group, 3), np.float32))
    with pytest.raises(ValueError, match="group must be 0 or more"):
        inbox.put(-1, np.zeros((SMALL.group, SMALL.cells), np.float32))
