"""Frames and the fountain, given what no sender made."""

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
from link.coding.crc import crc32c
from link.coding.fountain import (
    MOST_BYTES,
    Gathering,
    codable,
    pack_file,
    packets,
    source_blocks,
    source_symbols,
    unpack_file,
)
from link.coding.frames import Frame, read_frame, write_frame
from link.coding.reed_solomon import ReedSolomon
from link.layout import Layout
from link.mode import Mode
from tests.link.coding.soft import soft_of

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
