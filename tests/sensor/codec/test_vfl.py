"""Packet files: round trips, parts, bounded memory, damage."""

from __future__ import annotations

import struct

import fastcrc
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Clock, InputError, Viform
from cosim.spikes.viform import words_for
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.vfl import VflStream, write_vfl
from tests.sensor.codec.packets.streams import steady

CODES = (
    StreamCode(tile=16), StreamCode("raw", 64, 16), StreamCode("first-spike", 512),
    StreamCode("statistical", 128, 16, k=3.0, refine=8, threshold=1000.0), StreamCode(layers=3),
    StreamCode("event", 96),
)  # fmt: skip
HEAD = 80


@pytest.fixture(scope="module")
def stream():
    rng = np.random.default_rng(3)
    words = steady(0.5 * rng.random((19, 23)), rng.random((19, 23)), 300, 0.2)
    return Viform(words, 300, Clock(1_000_000, 49), -5)


def refused(path):
    with pytest.raises(InputError) as caught:
        VflStream(path).read_words(0, 1)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("code", CODES, ids=lambda code: code.kind)
def test_a_stream_comes_back_in_any_part(stream, tmp_path, code):
    path = tmp_path / "a.vfl"
    assert write_vfl(stream, path, code) == path.stat().st_size
    again = VflStream(path)
    for name in ("shape", "cycles", "clock", "start"):
        assert getattr(again, name) == getattr(stream, name)
    assert again.code == code
    total = words_for(300)
    whole = again.read_words(0, total)
    assert np.array_equal(whole, stream.words) == code.lossless
    for first, stop in ((0, 1), (3, 5), (9, 10), (4, 4), (2, 9)):
        assert np.array_equal(again.read_words(first, stop), whole[first:stop])


def test_a_file_of_one_pixel_and_one_cycle(tmp_path):
    path = tmp_path / "a.vfl"
    stream = Viform(np.ones((1, 1, 1), np.uint32), 1, Clock(40_000))
    write_vfl(stream, path, StreamCode())
    assert VflStream(path).read_words(0, 1).tolist() == [[[1]]]


class Endless:
    """A stream that is made as it is read, and says how much of it is read at a time."""

    def __init__(self, cycles):
        self.shape, self.cycles, self.clock, self.most = (16, 16), cycles, Clock(40_000), 0

    def read_words(self, first, stop):
        self.most = max(self.most, stop - first)
        rng = np.random.default_rng(first)
        return (rng.random((stop - first, 16, 16)) < 0.1).astype(np.uint32)


def test_a_long_stream_is_written_and_read_a_group_at_a_time(tmp_path):
    long, path = Endless(32 * 400), tmp_path / "a.vfl"
    write_vfl(long, path, StreamCode(tile=16))
    assert long.most == 4
    again = VflStream(path)
    assert np.array_equal(again.read_words(396, 400), long.read_words(396, 400))
    assert again._kept[1].nbytes == 4 * 4 * 256


def test_files_that_are_cut_or_changed_are_refused(stream, tmp_path):
    path = tmp_path / "a.vfl"
    write_vfl(stream, path, CODES[0])
    data = path.read_bytes()
    rng = np.random.default_rng(5)
    for size in (0, 7, 8, 50, 83, 84, 90, 200, len(data) - 1):
        path.write_bytes(data[:size])
        refused(path)
    path.write_bytes(data + b"\0")
    assert "bytes after its last packet" in refused(path)
    for at in rng.integers(0, len(data), 300):
        worse = bytearray(data)
        worse[at] ^= 1 << rng.integers(8)
        path.write_bytes(worse)
        refused(path)
    for size in (0, 10, 1000):
        path.write_bytes(rng.bytes(size))
        refused(path)
    packet = struct.unpack_from("<I", data, HEAD + 4)[0] + 4
    second = struct.unpack_from("<I", data, HEAD + 4 + packet)[0] + 4
    one, two = (data[HEAD + 4 + a : HEAD + 4 + a + n] for a, n in ((0, packet), (packet, second)))
    path.write_bytes(data[: HEAD + 4] + two + one + data[HEAD + 4 + packet + second :])
    assert "packets in another order" in refused(path)
    with pytest.raises(InputError, match="must be readable"):
        VflStream(tmp_path / "no.vfl")


def sealed(data: bytes) -> bytes:
    """The file with its checksums made good."""
    made = bytearray(data)
    made[HEAD : HEAD + 4] = struct.pack("<I", fastcrc.crc32.iscsi(bytes(made[:HEAD])))
    at = HEAD + 4
    while at + 20 <= len(made):
        (size,) = struct.unpack_from("<I", made, at)
        body = bytes(made[at + 4 : at + 16]) + bytes(made[at + 20 : at + 4 + size])
        made[at + 16 : at + 20] = struct.pack("<I", fastcrc.crc32.iscsi(body))
        at += 4 + size
    return bytes(made)


@given(st.integers(0, 4), st.lists(st.tuples(st.integers(0, 10**6), st.binary(min_size=1,
       max_size=6)), min_size=1, max_size=3))  # fmt: skip
def test_a_file_whose_checksums_were_made_good_is_read_or_refused(tmp_path_factory, which, changes):
    path = tmp_path_factory.getbasetemp() / "fuzz.vfl"
    planes = np.random.default_rng(8).random((200, 2, 3)) < 0.2
    write_vfl(Viform.from_planes(planes, Clock(40_000)), path, CODES[which])
    data = bytearray(path.read_bytes())
    for at, new in changes:
        at %= len(data)
        data[at : at + len(new)] = new[: len(data) - at]
    path.write_bytes(sealed(bytes(data)))
    try:
        again = VflStream(path)
        words = again.read_words(0, words_for(again.cycles))
    except InputError as exc:
        assert "\n" not in str(exc)
        return
    assert words.dtype == np.uint32
    assert not (words[-1] >> np.uint32((again.cycles - 1) % 32) >> np.uint32(1)).any()
