"""Blocks with a rate each: shapes, headers, and a file through a channel whose noise changes."""

from __future__ import annotations

import numpy as np
import pytest

from link.coding import Inbox, Outbox, blocks_of
from link.coding.adaptive_blocks import HEADER, AdaptiveBlocks
from link.layout import Layout
from link.line_codes import encode_line
from link.mode import EVERY_RATE, Mode
from tests.link.coding.ldpc_channel import noise_at
from tests.link.theory.test_words import needed

SIZES = [(128, 2), (256, 2), (416, 3), (960, 2), (960, 16)]


def form_of(size: int, cell: int = 2, interleave: bool = True) -> AdaptiveBlocks:
    mode = Mode(size, size, cell, 1, "scrambled", None, adaptive=True)
    form = blocks_of(Layout(mode), interleave)
    assert isinstance(form, AdaptiveBlocks)
    return form


@pytest.mark.parametrize(("size", "cell"), SIZES)
def test_blocks_of_all_rates_hold_equal_frames_and_are_full(size: int, cell: int) -> None:
    form = form_of(size, cell)
    bits = form.groups * form.layout.group * form.layout.cells
    for number, rate in enumerate(EVERY_RATE):
        one = form.at(number)
        assert (one.groups, one.frame_bytes, one.symbol_bytes) == (
            form.groups, form.frame_bytes, form.symbol_bytes,
        )  # fmt: skip
        sent = one.words * one.code.word_bits
        assert bits - 8 * one.words < sent <= bits
        full = one.frames / (one.frames + 1)  # less than one frame more has no room
        assert 0.999 * full * rate < one.code.rate <= rate
        assert one.code.data_bits == form.code.data_bits
    each = sum(form.at(n).code.rate / rate for n, rate in enumerate(EVERY_RATE)) / len(EVERY_RATE)
    assert each > 0.975
    frames = [form.at(n).frames for n in np.argsort(EVERY_RATE)]
    assert frames == sorted(frames)


@pytest.mark.parametrize("interleave", [True, False])
def test_words_and_header_come_back(interleave: bool) -> None:
    """The header replaces bits of the words, which are read as erased; all others are right."""
    rng = np.random.default_rng(1)
    for number in (0, 6, len(EVERY_RATE) - 1):
        form = form_of(128, interleave=interleave).at(number)
        words = rng.integers(0, 256, (form.words, form.word_bytes), dtype=np.uint8)
        values = form.lay(words, 3)
        row = np.zeros((form.groups, form.layout.group, form.layout.cells), np.int8)
        for n in range(form.groups):
            bits = encode_line("scrambled", values[n][None])
            soft = np.where(bits, np.float32(5), np.float32(-5))
            form.store(soft, 3 * form.groups + n, row[n])
        assert form.read_header(row) == number
        got = form.collect(row)
        expected = np.unpackbits(words, axis=1, bitorder="little").astype(bool)
        assert (got == 0).sum() <= HEADER
        assert ((got > 0) == expected)[got != 0].all()


def test_headers_are_far_apart_and_spread() -> None:
    rows = AdaptiveBlocks.rows.astype(int)
    apart = (rows[:, None] != rows).sum(axis=2)
    assert (apart + 128 * np.eye(len(rows), dtype=int) == 128).all()
    assert len(rows) >= len(EVERY_RATE)
    for size, cell in SIZES:
        form = form_of(size, cell)
        places = form.places
        assert (np.diff(places) > 0).all()
        cells = form.layout.data[places % form.layout.cells]
        row, column = np.divmod(cells, form.layout.shape[1])
        for of, count in ((row, form.layout.shape[0]), (column, form.layout.shape[1])):
            quarter = np.bincount(4 * of // count, minlength=4)
            assert quarter.min() > HEADER / 10  # half of the panel may be hidden


def test_a_header_is_read_in_strong_noise() -> None:
    """A fifth of the bits wrong, and half of them not received."""
    form, rng = form_of(128), np.random.default_rng(2)
    for number in range(len(EVERY_RATE)):
        row = np.zeros((form.groups, form.layout.group, form.layout.cells), np.int8)
        for _ in range(20):
            wrong = rng.random(HEADER) < 0.2
            kept = rng.random(HEADER) < 0.5
            bits = form.rows[number] ^ wrong
            row.reshape(-1)[form.places] = np.where(kept, 4 * (2 * bits.astype(int) - 1), 0)
            assert form.read_header(row) == number
    assert form.read_header(row) is None  # erased by the reading


@pytest.mark.slow
def test_a_file_through_noise_that_comes_and_goes() -> None:
    """The rates follow the noise, with one word in ten thousand to be lost."""
    mode = Mode(128, 128, 2, 1, "scrambled", None, adaptive=True)
    data = np.random.default_rng(3).bytes(400_000)
    shares = (0.97, 0.8, 0.65, 0.4, 0.7, 0.91)
    rates = [EVERY_RATE.index(rate) for rate in shares] * 20
    box = Outbox(data, "a.bin", Layout(mode), rates=rates)
    inbox, rng = Inbox(Layout(mode)), np.random.default_rng(4)
    form = form_of(128)
    assert box.frames == sum(form.at(n).frames for n in rates[: box.groups // form.groups])
    for n in range(box.groups):
        rate = EVERY_RATE[rates[n // form.groups]]
        sigma = noise_at(rate / needed(rate, 1e-4), rate)
        bits = encode_line("scrambled", box.values(n)[None])
        seen = 2 * bits.astype(np.float32) - 1 + sigma * rng.standard_normal(bits.shape)
        inbox.put(n, (seen * 2 / sigma**2).astype(np.float32))
    assert inbox.file is not None and inbox.file.data == data
    assert inbox.codewords_wrong <= 2
    assert box.frames_by(box.groups) == box.frames and box.words_by(0) == 0
    assert box.groups_for(box.frames + 1) is None and box.groups_for(0) == 0
    assert box.word_rate == pytest.approx(
        np.mean([EVERY_RATE[n] for n in rates[: box.groups // form.groups]])
    )


def test_rates_belong_to_a_mode_with_a_rate_for_each_block() -> None:
    adaptive = Layout(Mode(128, 128, 2, 1, "scrambled", None, adaptive=True))
    single = Layout(Mode(128, 128, 2, 1, "scrambled", None, 0.8))
    for layout, rates in ((adaptive, []), (single, [3])):
        with pytest.raises(ValueError, match="rates must be given"):
            Outbox(b"abc", "a", layout, rates=rates)
