"""Words with soft decisions in cells: laid and collected, with losses, obstacles and noise."""

import numpy as np
import pytest

from link.coding import Inbox, Outbox, blocks_of
from link.coding.ldpc import quantise
from link.coding.soft_blocks import SoftBlocks, gather_words, mark_changed
from link.coding.stream_boxes import StreamInbox, StreamOutbox, stream_blocks
from link.layout import PERIOD, Layout
from link.mode import RATES, Mode
from tests.link.coding.soft import soft_of


def layout_of(rate: float = 0.91, size: tuple[int, int] = (256, 224), cell: int = 2) -> Layout:
    return Layout(Mode(*size, cell, 1, "scrambled", None, rate))


def form_of(layout: Layout, interleave: bool = True) -> SoftBlocks:
    form = blocks_of(layout, interleave)
    assert isinstance(form, SoftBlocks)
    return form


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(("size", "cell"), [((960, 960), 2), ((128, 160), 4), ((128, 128), 12)])
def test_words_fill_a_block(rate, size, cell):
    """Less than a word's last bytes are left, of words that are neither too short nor too long."""
    layout = layout_of(rate, size, cell)
    form = form_of(layout)
    bits = form.groups * layout.group * layout.cells
    assert PERIOD // layout.group % form.groups == 0
    assert 4096 <= form.code.word_bits <= 8448 / rate + 8
    assert form.words == bits // form.code.word_bits and bits - form.words * form.code.word_bits < (
        8 * form.words
    )
    assert rate - 16 / form.code.word_bits < form.code.rate <= rate
    assert form.code.lifting % 16 == 0  # or a device could not decode them
    carried = form.frames * form.symbol_bytes * 8 / bits
    assert 0.9 * rate < carried < rate


@pytest.mark.parametrize("interleave", [True, False])
def test_what_is_laid_is_collected(interleave):
    layout = layout_of(0.84)
    form = form_of(layout, interleave)
    rng = np.random.default_rng(1)
    words = rng.integers(0, 256, (form.words, form.word_bytes), dtype=np.uint8)
    row = np.zeros((form.groups, layout.group, layout.cells), np.int8)
    for n, values in enumerate(form.lay(words, 5)):
        group = 5 * form.groups + n
        form.store(soft_of(layout, values), group, row[n])
    assert (np.packbits(form.collect(row) > 0, axis=1, bitorder="little") == words).all()
    marks = rng.random((form.words, form.code.word_bits)) < 0.01
    packed = np.packbits(marks, axis=1, bitorder="little")
    laid = np.zeros((form.groups * layout.group, layout.cells), np.uint8)
    places = np.arange(form.words)[:, None] + form.order * form.words
    if not interleave:
        places = np.arange(marks.size).reshape(marks.shape)
    laid.reshape(-1)[places] = marks
    assert (form.cells_of(packed) == laid.sum(axis=0)).all()


def test_soft_values_are_quantised_without_the_keystream():
    """NaN is an erasure, and what lies beyond the range is at its end."""
    layout = layout_of(0.84)
    form = form_of(layout)
    soft = np.random.default_rng(2).normal(0, 9, (layout.group, layout.cells)).astype(np.float32)
    soft[0, :4] = np.nan, np.inf, -np.inf, 0
    out = np.empty(soft.shape, np.int8)
    form.store(soft, 3, out)
    stream = np.unpackbits(form.keystream(3)[None, : layout.cells], axis=0, bitorder="little")
    assert (out == quantise(soft) * (1 - 2 * stream.view(np.int8))).all()
    assert np.abs(out).max() == 31 and out[0, 0] == out[0, 3] == 0


def test_only_decisions_of_read_words_are_marked():
    rng = np.random.default_rng(4)
    soft = rng.integers(-31, 32, (5, 64), dtype=np.int8)
    sent = rng.integers(0, 256, (5, 8), dtype=np.uint8)
    ok = np.array([True, False, True, True, False])
    out = np.full_like(sent, 9)
    mark_changed(0, 5, soft.view(np.uint64), sent, ok, out)
    wrong = ((soft > 0) != np.unpackbits(sent, axis=1, bitorder="little")) & (soft != 0)
    wrong[~ok] = False
    assert (np.unpackbits(out, axis=1, bitorder="little") == wrong).all()


@pytest.mark.parametrize("words", [1, 7, 8, 13, 194])
@pytest.mark.parametrize("bits", [8, 520])
def test_gathered_words_are_those_of_numpy(words: int, bits: int) -> None:
    rng = np.random.default_rng(1)
    row = rng.integers(-128, 128, (bits, words)).astype(np.int8)
    order, out = rng.permutation(bits), np.empty((words, bits), np.int8)
    gather_words(0, bits // 8, row, order, out.view(np.uint64))
    assert (out == row[order].T).all()


def test_an_obstacle_takes_as_many_bits_of_every_word():
    """A wide one takes as many of the columns of the graph as well, within chance."""
    layout = layout_of(0.88, (960, 960))
    form = form_of(layout)
    row = np.zeros((form.groups, layout.group, layout.cells), np.int8)
    row[..., : layout.cells // 20] = 1
    hidden = form.collect(row) > 0
    share = hidden.mean(axis=1)
    assert abs(share - 0.05).max() < 0.002
    z = form.code.lifting
    used = form.code.word_bits // z * z
    columns = hidden[:, :used].reshape(form.words, -1, z).mean(axis=2)
    assert columns.max() < 0.1


@pytest.mark.parametrize("interleave", [True, False])
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(("size", "cell"), [((256, 224), 2), ((128, 160), 4)])
def test_a_noiseless_round_trip_is_bit_exact(rate, size, cell, interleave):
    layout = layout_of(rate, size, cell)
    data = np.random.default_rng(2).bytes(3000)
    outbox = Outbox(data, "a.bin", layout, interleave=interleave)
    inbox = Inbox(layout, interleave=interleave)
    for group in range(outbox.groups):
        inbox.put(group, soft_of(layout, outbox.values(group)))
    assert inbox.file is not None and inbox.file.data == data
    assert inbox.frames_right == inbox.frames_read == outbox.frames
    assert inbox.codewords_wrong == inbox.bytes_corrected == 0 and not inbox.cell_errors.any()
    # Parity that is not sent takes a round more, and at the highest rate two.
    assert inbox.codewords <= inbox.rounds <= 3 * inbox.codewords


def noisy(layout: Layout, values: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Soft values of signs in white noise."""
    seen = soft_of(layout, values, 1.0)
    seen += np.float32(sigma) * rng.standard_normal(seen.shape, np.float32)
    return seen * np.float32(2 / sigma**2)


def test_noise_is_corrected_and_counted(device):
    """What the words' code corrects is what the decisions had wrong; on a device too."""
    layout = layout_of(0.84)
    data = np.random.default_rng(3).bytes(40_000)
    outbox, form = Outbox(data, "x", layout), form_of(layout)
    seen = []
    for where in (None, device):
        rng, wrong = np.random.default_rng(4), np.zeros(layout.cells, np.int64)
        inbox = Inbox(layout, device=where)
        for group in range(outbox.groups):
            values = outbox.values(group)
            soft = noisy(layout, values, 0.45, rng)
            wrong += ((soft > 0) != (soft_of(layout, values) > 0)).sum(axis=0)
            inbox.put(group, soft)
        assert inbox.file is not None and inbox.file.data == data
        assert inbox.codewords == outbox.groups // form.groups * form.words
        assert inbox.codewords_wrong == 0 and inbox.rounds > 2 * inbox.codewords
        # Bits that fill no word are not corrected, and those with a soft value near 0 not counted.
        assert (inbox.cell_errors <= wrong).all()
        assert wrong.sum() - inbox.cell_errors.sum() < 0.1 * wrong.sum()
        seen.append((inbox.rounds, inbox.bytes_corrected, inbox.cell_errors.tolist()))
    assert seen[0] == seen[1]
    _, _, cells = seen[0]
    assert 0 < seen[0][1] <= sum(cells)


def test_without_soft_values_nothing_is_a_word():
    """Zeros, NaN, and a dark panel, whose bits are the keystream."""
    layout = layout_of()
    for soft in (0.0, np.nan, -9.0):
        inbox = Inbox(layout)
        for group in range(form_of(layout).groups):
            inbox.put(group, np.full((layout.group, layout.cells), soft, np.float32))
        assert inbox.frames_right == 0 and inbox.codewords_wrong == inbox.codewords > 0


@pytest.mark.parametrize(("rate", "enough"), [(0.75, True), (0.97, False)])
def test_missing_groups_are_erasures(rate, enough):
    """A ninth or so of the bits of a block of several groups."""
    layout = layout_of(rate, (128, 128), 12)
    form = form_of(layout)
    assert form.groups >= 8
    outbox, inbox = Outbox(b"hello", "x", layout), Inbox(layout)
    for group in range(1, form.groups):
        inbox.put(group, soft_of(layout, outbox.values(group)))
    assert inbox.file is None
    inbox.flush()
    assert (inbox.file is not None) == enough


def test_damage_never_delivers_a_wrong_file():
    layout = layout_of(0.91)
    rng = np.random.default_rng(5)
    for share in (0.003, 0.02, 0.3, 1.0):
        data = rng.bytes(20_000)
        outbox, inbox = Outbox(data, "x", layout), Inbox(layout)
        for group in rng.permutation(outbox.groups):
            soft = soft_of(layout, outbox.values(int(group)))
            bad = rng.random(soft.shape) < share
            soft[bad] = rng.normal(0, 5, int(bad.sum()))
            inbox.put(int(group), soft)
        assert inbox.file is None or inbox.file.data == data
        assert (inbox.file is not None) == (share < 0.1)


def test_packets_of_a_stream_arrive():
    """A receiver that joins a period late reads on."""
    layout = layout_of(0.88, (128, 160), 4)
    rng = np.random.default_rng(6)
    packets = [rng.bytes(int(n)) for n in rng.integers(0, 900, 600)]
    waiting = iter(packets)
    form = stream_blocks(layout)
    assert form.period is not None
    blocks = 2 * form.period // form.groups
    outbox = StreamOutbox(form, blocks, lambda block: next(waiting, None))
    inbox = StreamInbox(layout)
    for group in range(outbox.groups):
        values = outbox.values(group)
        if group >= form.period:
            inbox.put(group - form.period, soft_of(layout, values))
    got = [a.packet for a in inbox.arrivals]
    begin = packets.index(got[0])
    assert len(got) > 20 and got == packets[begin : begin + len(got)]
