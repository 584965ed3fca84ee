"""From a file to values and back: whole, with losses, with damage, and with what is no file.

Frames and the fountain, given what no sender made.
"""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest
import raptorq
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import InputError
from link.coding import Blocks, Inbox, Outbox
from link.coding.boxes import Frame, read_frame, write_frame
from link.coding.crc import crc32c
from link.coding.fountain import Gathering, codable, packets, source_blocks, source_symbols
from link.coding.packed_file import MOST_BYTES, pack_file, unpack_file
from link.coding.reed_solomon import ReedSolomon
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


SYMBOL, SIZE = 104, 127
FRAME = Frame(0x12345678, 1000, bytes([0, 0, 0, 3]) + bytes(range(SYMBOL)))


def sealed(body: bytes) -> np.ndarray:
    return np.frombuffer(body + struct.pack("<I", crc32c(body)), np.uint8)


def test_a_frame_is_read_as_it_was_written():
    data = write_frame(FRAME, SIZE)
    assert len(data) == SIZE and read_frame(data, SYMBOL) == FRAME
    assert data[:3].tobytes() == b"Vf\x01"


def test_no_bit_may_be_another():
    data = write_frame(FRAME, SIZE)
    for bit in range(8 * SIZE):
        wrong = data.copy()
        wrong[bit // 8] ^= 1 << bit % 8
        assert read_frame(wrong, SYMBOL) is None


@given(st.binary(max_size=200))
def test_bytes_of_chance_are_no_frame(data):
    assert read_frame(np.frombuffer(data, np.uint8), SYMBOL) is None


@pytest.mark.parametrize("length", [0, MOST_BYTES + 1, 2**32 - 1])
def test_a_length_that_cannot_be(length):
    assert read_frame(write_frame(replace(FRAME, length=length), SIZE), SYMBOL) is None


def test_what_is_sealed_but_no_frame():
    body = write_frame(FRAME, SIZE)[:-4].tobytes()
    assert read_frame(sealed(body), SYMBOL) == FRAME
    assert read_frame(sealed(body[:40]), SYMBOL) is None  # cut
    assert read_frame(sealed(b"Wf" + body[2:]), SYMBOL) is None
    assert read_frame(sealed(body[:2] + b"\x02" + body[3:]), SYMBOL) is None
    other = replace(FRAME, packet=b"\x01" + FRAME.packet[1:])  # a block that a file has not
    assert read_frame(write_frame(other, SIZE), SYMBOL) is None


@settings(max_examples=10)
@given(st.data())
def test_forged_frames_deliver_nothing_and_stop_nothing(data):
    """Right in every CRC and code, wrong in what they carry; an honest file comes after them."""
    layout = Layout(Mode(128, 128, 4, 1, "8b10b", 128))
    blocks, inbox = Blocks(layout), Inbox(layout)
    for n in range(data.draw(st.integers(1, 8))):
        length = data.draw(st.sampled_from([1, 9, 50, 500, 5000, MOST_BYTES]))
        session = data.draw(st.integers(0, 5))
        number = bytes([0]) + data.draw(st.binary(min_size=3, max_size=3))
        symbol = data.draw(st.binary(min_size=blocks.symbol_bytes, max_size=blocks.symbol_bytes))
        framed = write_frame(Frame(session, length, number + symbol), blocks.frame_bytes)
        words = np.zeros((blocks.words, blocks.data_bytes), np.uint8)
        words[: blocks.frame_words] = framed.reshape(blocks.frame_words, -1)
        values = blocks.lay(ReedSolomon(128).encode(words), n)
        softs = enumerate(soft_of(layout, v) for v in values)
        assert sum(inbox.put(n * blocks.groups + k, soft) for k, soft in softs) == 1
    assert inbox.file is None
    honest = Outbox(b"honest", "x", layout)
    for group in range(honest.groups):
        inbox.put(group, soft_of(layout, honest.values(group)))
    assert inbox.file is not None and inbox.file.data == b"honest"


@given(st.binary(max_size=300))
def test_bytes_of_chance_are_no_file(data):
    assert unpack_file(data) is None


@pytest.mark.parametrize("size", [0, 1, 103, 104, 105, 5000])
def test_any_packets_bring_a_file_back(size):
    data = np.random.default_rng(size).bytes(size)
    _, packed = pack_file(data, "dir/n.txt")
    own = source_symbols(len(packed), SYMBOL)
    made = packets(packed, SYMBOL, 2 * own + 2)
    assert len(made) == len({packet[:4] for packet in made}) == 2 * own + 2
    for order in (made, made[::-1], made[own:]):
        gathering = Gathering(len(packed), SYMBOL)
        files = [gathering.put(packet) for packet in (*order[:own], *order[: own + 2])]
        whole = [file for file in files if file is not None]
        assert whole[0].data == data and whole[0].name == "n.txt"
        assert gathering.needed == own


def test_one_wrong_packet_throws_the_file_away_and_it_may_come_again():
    """The library believes every packet; the CRC of the whole does not."""
    data = np.random.default_rng(1).bytes(3000)
    _, packed = pack_file(data, "x")
    made = packets(packed, SYMBOL, 60)
    gathering = Gathering(len(packed), SYMBOL)
    wrong = made[5][:50] + bytes([made[5][50] ^ 1]) + made[5][51:]
    first = [gathering.put(packet) for packet in (*made[:5], wrong, *made[6:40])]
    second = [gathering.put(packet) for packet in made]
    assert not any(first)
    assert [file.data for file in second if file is not None][:1] == [data]


BLOCK = 56403
"""Symbols of a block, at most (RFC 6330, section 5.1.2)."""


@pytest.mark.parametrize(
    ("length", "symbol"),
    [(0, SYMBOL), (9, 0), (9, 2**16), (200, 65), (MOST_BYTES + 1, 1024), (255 * BLOCK * 8 + 1, 8)],
)
def test_what_the_library_cannot_code_is_not_given_to_it(length, symbol, capfd):
    """Each of them panics it, or is cut to another size of symbols."""
    assert not codable(length, symbol)
    with pytest.raises(ValueError, match="must be codable"):
        Gathering(length, symbol)
    framed = write_frame(Frame(1, length, bytes(4 + symbol)), symbol + 23)
    assert read_frame(framed, symbol) is None
    if length < MOST_BYTES:
        with pytest.raises(InputError, match="must be one that the fountain code can encode"):
            packets(bytes(length), symbol, 3)
    assert capfd.readouterr().err == ""


def test_more_packets_than_there_are_numbers_are_refused(capfd):
    with pytest.raises(InputError, match="must be one that the fountain code can encode"):
        packets(bytes(100), SYMBOL, 2**24)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(("length", "symbol"), [(1, 1), (9, 8), (100, 63), (100, 64), (5000, 72)])
def test_what_is_codable_has_symbols_of_that_size(length, symbol, capfd):
    data = np.random.default_rng(length).bytes(length)
    made = packets(data, symbol, source_symbols(length, symbol) + 2)
    assert {len(packet) for packet in made} == {4 + symbol}
    assert b"".join(packet[4:] for packet in made[:-2])[:length] == data
    assert capfd.readouterr().err == ""


def test_a_file_that_panics_the_library_is_one_line(monkeypatch, capfd):
    real = raptorq.Encoder.with_defaults

    class Faulty:
        @staticmethod
        def with_defaults(data: bytes, symbol: int) -> object:
            return real(data, 0)

    monkeypatch.setattr(raptorq, "Encoder", Faulty)
    with pytest.raises(InputError, match="must be one that the fountain code can encode") as said:
        packets(bytes(100), SYMBOL, 3)
    assert "\n" not in str(said.value) and "max_packet_size" in str(said.value)
    assert capfd.readouterr().err == ""


def test_packets_that_are_not_of_the_file_are_ignored(capfd):
    _, packed = pack_file(b"some bytes", "x")
    gathering = Gathering(len(packed), SYMBOL)
    whole = packets(packed, SYMBOL, 1)[0]
    for wrong in (b"", whole[:3], whole[:-1], whole + b"x", b"\x09" + whole[1:]):
        assert gathering.put(wrong) is None
    assert len(gathering) == 0 and capfd.readouterr().err == ""
    file = gathering.put(whole)
    assert file is not None and file.data == b"some bytes"


def test_a_panic_while_decoding_loses_the_packets_alone(monkeypatch, capfd):
    _, packed = pack_file(bytes(1000), "x")
    made = packets(packed, SYMBOL, 12)
    with monkeypatch.context() as patched:
        patched.setattr(raptorq, "Decoder", Panicking)
        gathering = Gathering(len(packed), SYMBOL)
        assert [gathering.put(packet) for packet in made[: gathering.needed]].count(None) > 9
    gathering._begin()
    files = [gathering.put(packet) for packet in made]
    assert [file.data for file in files if file is not None] == [bytes(1000)]
    assert capfd.readouterr().err == ""


class Panicking:
    """A decoder with a fault that shows when it computes."""

    def __init__(self, length: int, symbol: int) -> None:
        self._left = source_symbols(length, symbol)

    @classmethod
    def with_defaults(cls, length: int, symbol: int) -> Panicking:
        return cls(length, symbol)

    def decode(self, packet: bytes) -> None:
        self._left -= 1
        if not self._left:
            raptorq.Encoder.with_defaults(b"x", 0)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_no_packets_of_right_form_panic_the_library(data):
    """Whatever their numbers are and whatever they carry, the muted decoder is not needed."""
    symbol, blocks = data.draw(st.sampled_from([1, 8, 64])), 1
    length = data.draw(st.integers(1, 60 * symbol))
    assert source_blocks(length, symbol) == blocks
    decoder = raptorq.Decoder.with_defaults(length, symbol)
    seed, spread = data.draw(st.integers(0, 2**32)), data.draw(st.sampled_from([20, 100, 2**24]))
    rng = np.random.default_rng(seed)
    for number in rng.choice(spread, size=min(spread, 80), replace=False):
        decoder.decode(b"\0" + int(number).to_bytes(3, "big") + rng.bytes(symbol))


@pytest.mark.slow
def test_files_of_several_blocks_share_their_losses():
    """Past 56403 symbols; a tenth is lost in one stretch of time."""
    data = np.random.default_rng(2).bytes(56403 * SYMBOL + 1000)
    _, packed = pack_file(data, "x")
    own = source_symbols(len(packed), SYMBOL)
    assert source_blocks(len(packed), SYMBOL) == 2
    made = packets(packed, SYMBOL, int(own * 1.12))
    assert {packet[0] for packet in made} == {packet[0] for packet in made[:10]} == {0, 1}
    gathering = Gathering(len(packed), SYMBOL)
    files = [gathering.put(packet) for packet in (*made[: own // 2], *made[own * 6 // 10 :])]
    assert [file.data == data for file in files if file is not None] == [True]
