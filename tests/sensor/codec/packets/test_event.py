"""Packets of events: the words by hand and from the plain first-spike code, gaps, damage."""

from __future__ import annotations

import fastcrc
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Clock, Viform
from cosim.spikes.viform import pack_planes
from sensor.codec.columns import Damaged
from sensor.codec.packets.event import Event, Gap, encode_events, packet_of_line
from sensor.codec.packets.packet import Packet
from sensor.codec.trains import first_spikes
from tests.cosim.spikes.whole_streams import events_of
from tests.sensor.codec.packets.streams import random_stream
from tests.sensor.codec.packets.told import gaps_of

CYCLES = (1, 31, 32, 100, 128)


def halves(data):
    return np.frombuffer(data, "<u2").tolist()


def planes_of(seed, cycles):
    """(cycles, h, w) spikes, of steady trains or at random."""
    words, _ = random_stream(seed)
    bits = words[..., None] >> np.arange(32, dtype=np.uint32) & np.uint32(1)
    planes = np.moveaxis(bits, -1, 1).reshape(-1, *words.shape[1:])
    return np.resize(planes, (cycles, *planes.shape[1:]))[:, :128, :128].astype(bool)


def plain(planes):
    """The words from the quadruples of trains.py."""
    cycles = len(planes)
    first = first_spikes(events_of(Viform(pack_planes(planes), cycles, Clock(40_000))))
    words, before = [], None
    for i, j, t, tau in zip(first.row, first.column, first.time, first.width, strict=True):
        if (t, i) != before:
            words.append(min(int(t), cycles - 1) << 7 | int(i))
            before = (t, i)
        words.append(0x8000 | (t == cycles) << 14 | int(tau - 1) << 7 | int(j))
    return words


def test_words_by_hand():
    planes = np.zeros((8, 2, 3), bool)
    planes[[1, 3, 5, 7], 1, 2] = True  # every second cycle: one first spike
    planes[[0, 1, 2], 0, 0] = True  # three widths of 1, then dark
    planes[4, 0, 0] = True  # width 2, and nothing after it: the next would be at 6
    planes[2, 1, 0] = True  # width 3, and a second one at 5 that does not come
    assert halves(encode_events(pack_planes(planes), 8)) == [
        0 << 7 | 0, 0x8000 | 0 << 7 | 0,
        1 << 7 | 1, 0x8000 | 1 << 7 | 2,
        2 << 7 | 1, 0x8000 | 2 << 7 | 0,
        4 << 7 | 0, 0x8000 | 1 << 7 | 0,
        7 << 7 | 0, 0xC000 | 3 << 7 | 0,
        7 << 7 | 1, 0xC000 | 5 << 7 | 0,
    ]  # fmt: skip


@given(st.integers(0, 10**6), st.sampled_from(CYCLES))
def test_the_words_are_those_of_the_plain_code_and_come_back(seed, cycles):
    planes = planes_of(seed, cycles)
    words = pack_planes(planes)
    (layer,) = Event().encode(words, cycles)
    assert halves(layer.data) == plain(planes)
    assert layer.spikes == planes.sum()
    assert np.array_equal(Event().decode([layer.data], planes.shape[1:], cycles), words)
    assert gaps_of(layer.data, cycles) == []


@given(st.integers(0, 10**6), st.lists(st.integers(0, 10**9), max_size=6))
def test_gaps_are_said_and_have_no_spikes(seed, cuts):
    cycles = 96
    planes = planes_of(seed, cycles)
    rows = planes.shape[1]
    ends = sorted({cut % (cycles * rows) for cut in cuts})
    if len(ends) % 2:
        ends.append(cycles * rows)  # a gap up to the end
    gaps = [
        Gap(*divmod(a, rows), *divmod(b, rows)) for a, b in zip(ends[::2], ends[1::2], strict=True)
    ]
    data = encode_events(pack_planes(planes), cycles, gaps)
    assert gaps_of(data, cycles) == gaps
    flat = planes.reshape(cycles * rows, -1)
    for a, b in zip(ends[::2], ends[1::2], strict=True):
        flat[a:b] = False
    assert np.array_equal(Event().decode([data], planes.shape[1:], cycles), pack_planes(planes))


@given(st.integers(0, 10**6), st.integers(0, 10**6), st.integers(0, 15))
def test_changed_words_are_damaged_or_those_of_other_spikes(seed, at, bit):
    planes = planes_of(seed, 64)
    data = bytearray(encode_events(pack_planes(planes), 64))
    if not data:
        return
    data[at % len(data)] ^= 1 << bit % 8
    try:
        words = Event().decode([bytes(data)], planes.shape[1:], 64)
    except Damaged:
        return
    assert encode_events(words, 64, gaps_of(bytes(data), 64)) == data


@pytest.mark.parametrize(
    "words",
    [
        [0x8000],  # no row
        [0, 0x8000, 0],  # a row without an event
        [0, 0x8001, 0x8000],  # columns that fall
        [1 << 7, 0x8080, 0, 0x8000],  # cycles that fall
        [0, 0x8080],  # began before the packet
        [0, 0xC000],  # closing in the first cycle
        [0x4001, 0x4001, 0x4000],  # gaps that fall
        [0x4000, 0, 0x8000],  # an event in a gap
        [5, 0x8000],  # no such row
        [0, 0x8005],  # no such column
        [64 << 7, 0xA000],  # no such cycle
    ],
)
def test_words_that_cannot_be_are_damaged(words):
    data = np.array(words, "<u2").tobytes()
    with pytest.raises(Damaged):
        Event().decode([data], (4, 4), 64)


def test_half_a_word_is_damaged():
    with pytest.raises(Damaged, match="half a word"):
        Event().decode([b"\0"], (4, 4), 64)


def test_more_than_the_fields_hold_is_refused():
    for shape, cycles in (((4, 129, 1), 128), ((4, 1, 129), 128), ((5, 1, 1), 129)):
        with pytest.raises(ValueError, match="must have at most 128 x 128 pixels and 128 cycles"):
            encode_events(np.zeros(shape, np.uint32), cycles)


def test_the_checksum_of_a_line_stands_last():
    packet = Packet(4, 0, 7, 256, 128, b"\1\2\3\4")
    data = packet.to_bytes()
    line = data[:12] + data[16:] + data[12:16]
    assert fastcrc.crc32.iscsi(line[:-4]) == int.from_bytes(line[-4:], "little")
    assert packet_of_line(line) == packet
    for wrong in (line[:-1], line[:10], data):
        with pytest.raises(Damaged):
            packet_of_line(wrong)
