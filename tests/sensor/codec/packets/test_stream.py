"""Encoder and decoder of a stream: any cut into blocks, losses, states, garbage."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.spikes.viform import unpack_planes, words_for
from cosim.stage import Stateful
from sensor.codec.columns import Damaged
from sensor.codec.packets.catalogue import KINDS, StreamCode
from sensor.codec.packets.coder import StreamEncoder
from sensor.codec.packets.decoder import StreamDecoder
from sensor.codec.packets.packet import HEADER, LENGTH, Packet, Tiles
from tests.sensor.codec.packets.streams import steady

SHAPE, CYCLES = (21, 30), 333
CODES = (
    StreamCode(tile=16), StreamCode(cycles=512, tile=8), StreamCode("raw", 64, 16),
    StreamCode("first-spike", 96, 32), StreamCode(layers=4, tile=16),
    StreamCode("statistical", 128, 16, k=3.0, refine=8, threshold=1000.0),
    StreamCode("event", 64, 16), StreamCode(cycles=64, tile=8, phases=8),
    StreamCode("raw", 32, 16, phases=16), StreamCode("first-spike", 96, 8, phases=3),
)  # fmt: skip


@pytest.fixture(scope="module")
def words():
    rng = np.random.default_rng(1)
    return steady(0.6 * rng.random(SHAPE), rng.random(SHAPE), CYCLES, 0.2)


def packets_of(code, words, cut=1, cycles=CYCLES, through_state=False):
    encoder, packets = StreamEncoder(code, SHAPE), []
    for first in range(0, len(words), cut):
        block = words[first : first + cut]
        count = min(32 * len(block), cycles - 32 * first)
        packets += encoder.encode(block, 32 * first, count)
        if through_state:
            state, encoder = encoder.state(), StreamEncoder(code, SHAPE)
            encoder.restore(state)
    return packets + encoder.flush()


def fed(code, packets):
    decoder = StreamDecoder(code, SHAPE)
    taken = [decoder.take(packet.to_bytes()) for packet in packets]
    assert all(taken)
    return decoder


def test_every_kind_is_tried():
    assert {code.kind for code in CODES} == set(KINDS)


@pytest.mark.parametrize("code", CODES, ids=lambda code: f"{code.kind}-{code.cycles}-{code.phases}")
def test_the_packets_do_not_depend_on_the_cut_nor_the_words_on_the_reading(code, words):
    sent = packets_of(code, words)
    for cut in (2, 3, 11):
        assert packets_of(code, words, cut, through_state=True) == sent
    whole = fed(code, sent).read(CYCLES)
    decoder, parts = fed(code, sent[::-1]), []
    for until in (32, 160, 256, CYCLES):
        state, decoder = decoder.state(), StreamDecoder(code, SHAPE)
        decoder.restore(state)
        parts.append(decoder.read(until).words)
    assert np.array_equal(np.concatenate(parts), whole.words)
    assert np.array_equal(whole.words, words) == code.lossless
    assert not (whole.held.any() or whole.missing.any())
    assert not (whole.words[-1] >> np.uint32(CYCLES % 32)).any()


def test_with_phases_packets_end_all_the_time_and_the_tiles_of_each_lie_everywhere(words):
    code = StreamCode("raw", 64, 8, phases=8)
    sent = packets_of(code, words)
    ends = [packet.first + packet.cycles for packet in sent]
    assert ends == sorted(ends) and set(ends) == {*range(8, CYCLES, 8), CYCLES}
    tiles = Tiles(SHAPE, 8)
    offsets = tiles.offsets(64, 8).reshape(tiles.grid)
    assert all(len(set(row)) == len(row) for row in (*offsets, *offsets.T))
    for packet in sent:  # whole groups but for the first and the last one of a tile
        whole = packet.first and packet.first + packet.cycles < CYCLES
        assert packet.cycles == 64 or not whole


def test_a_group_that_was_decoded_takes_no_more_packets_and_others_do(words):
    code = StreamCode(cycles=64, tile=8, phases=8)
    sent, offsets = packets_of(code, words), Tiles(SHAPE, 8).offsets(64, 8)
    decoder = StreamDecoder(code, SHAPE)
    decoder.decode(65)
    begun = {p for p in range(len(sent)) if sent[p].first < 65}
    assert begun and [decoder.take(p.to_bytes()) for p in sent] == [
        n not in begun for n in range(len(sent))
    ]
    decoded = decoder.read(CYCLES)
    assert decoder.statistics["late"] == len(begun) and decoded.missing.all()
    for tile, offset in enumerate(offsets):
        rows, columns = Tiles(SHAPE, 8).place(tile)
        first = int(offset) + (64 if offset else 128)  # after the groups that were decoded
        kept = unpack_planes(decoded.words, first, CYCLES)[:, rows, columns]
        assert np.array_equal(kept, unpack_planes(words, first, CYCLES)[:, rows, columns])
        assert not unpack_planes(decoded.words, 0, first)[:, rows, columns].any()


def test_both_are_stages_with_a_state():
    assert isinstance(StreamEncoder(CODES[0], SHAPE), Stateful)
    assert isinstance(StreamDecoder(CODES[0], SHAPE), Stateful)


def test_a_lost_packet_damages_its_tile_and_its_cycles_alone(words):
    code = CODES[0]
    sent = packets_of(code, words)
    lost = next(p for p in sent if (p.first, p.tile, p.layer) == (128, 3, 0))
    decoded = fed(code, [p for p in sent if p is not lost]).read(CYCLES)
    rows, columns = Tiles(SHAPE, 16).place(3)
    wrong = decoded.words != words
    assert wrong[4:8, rows, columns].any()
    wrong[4:8, rows, columns] = False
    assert not wrong.any()
    assert decoded.held.tolist() == [[False, False], [False, True]]
    assert not decoded.missing.any()
    # Held at the rate that the tile had: the counts of the cycles before.
    before, now = (np.bitwise_count(part[:, rows, columns]).sum(axis=0)
                   for part in (words[:4], decoded.words[4:8]))  # fmt: skip
    assert np.array_equal(before, now)


@pytest.mark.parametrize("layer", range(1, 8))
def test_a_lost_finer_layer_keeps_the_coarser_ones(words, layer):
    code = CODES[0]
    sent = packets_of(code, words)
    decoder = fed(code, [p for p in sent if (p.first, p.layer) != (0, layer)])
    decoded = decoder.read(CYCLES)
    assert not decoded.held.any()
    assert np.array_equal(decoded.words[4:], words[4:])
    left = np.bitwise_count(decoded.words[:4]).sum(axis=0)
    assert left.sum() == np.bitwise_count(words[:4]).sum()
    assert np.array_equal(left, np.bitwise_count(words[:4]).sum(axis=0)) == (layer > 2)


def test_without_any_packet_tiles_are_missing_and_dark_and_reading_goes_on(words):
    decoder = StreamDecoder(CODES[0], SHAPE)
    decoded = decoder.read(256)
    assert decoded.missing.all()
    assert not decoded.words.any()
    sent = packets_of(CODES[0], words)
    assert not decoder.take(sent[0].to_bytes())  # late
    assert all(decoder.take(p.to_bytes()) for p in sent if p.first == 256)
    assert np.array_equal(decoder.read(CYCLES).words, words[8:])
    assert decoder.statistics["late"] == 1
    assert decoder.statistics["missing"] == 2 * 4


@given(st.integers(0, 10**6), st.integers(0, 7))
def test_a_changed_packet_is_refused(at, bit):
    data = bytearray(Packet(3, 1, 2, 128, 100, b"some data").to_bytes())
    data[at % len(data)] ^= 1 << bit
    with pytest.raises(Damaged):
        Packet.of(bytes(data))


@given(st.binary(max_size=40))
def test_garbage_is_counted_and_changes_nothing(data):
    decoder = StreamDecoder(CODES[0], SHAPE)
    assert not decoder.take(data)
    assert decoder.statistics["refused"] == 1


@pytest.mark.parametrize(
    "packet",
    [Packet(0, 0, 0, 0, 128, b""), Packet(3, 8, 0, 0, 128, b""), Packet(3, 0, 4, 0, 128, b""),
     Packet(3, 0, 0, 32, 128, b""), Packet(3, 0, 0, 0, 129, b"")],
)  # fmt: skip
def test_packets_of_another_stream_are_refused(packet):
    assert not StreamDecoder(CODES[0], SHAPE).take(packet.to_bytes())


def test_a_packet_whose_data_cannot_be_counts_as_damaged(words):
    sent = packets_of(CODES[0], words)
    worse = [
        Packet(p.code, p.layer, p.tile, p.first, p.cycles, b"\xff" * 50)
        if (p.layer, p.tile, p.first) == (7, 0, 0) else p for p in sent
    ]  # fmt: skip
    decoder = fed(CODES[0], worse)
    decoded = decoder.read(CYCLES)
    assert decoder.statistics["damaged"] == 1
    assert np.array_equal(decoded.words[:, :16, 16:], words[:, :16, 16:])
    counts = [np.bitwise_count(part[:4]).sum(axis=0) for part in (decoded.words, words)]
    assert np.array_equal(*counts)  # what was known without it


def test_blocks_must_follow_one_another(words):
    encoder = StreamEncoder(CODES[0], SHAPE)
    with pytest.raises(ValueError, match="a block must begin at cycle 0, not 32"):
        encoder.encode(words[:1], 32)
    encoder.encode(words[:1], 0, 20 * 0 + 32)
    with pytest.raises(ValueError, match="must not be"):
        encoder.encode(words[:2], 32, 20)
    with pytest.raises(ValueError, match="within the block"):
        encoder.encode(np.full((1, *SHAPE), 2**32 - 1, np.uint32), 32, 20)


def test_the_header_is_sixteen_bytes():
    assert HEADER == 16
    packet = Packet(3, 7, 9, 2**37 - 32, 512, b"a")
    assert len(packet.to_bytes()) == 17 and packet.size == 17 + LENGTH
    with pytest.raises(ValueError, match="below cycle 2"):
        Packet(3, 7, 9, 2**37, 512, b"").to_bytes()


@pytest.mark.parametrize(
    ("settings", "why"),
    [({"kind": "jpeg"}, "code must be one of raw"),
     ({"cycles": 100}, "cycles must be a multiple of 32 from 32 to 512, not 100"),
     ({"kind": "event", "cycles": 160}, "cycles must be at most 128 with event"),
     ({"tile": 12}, "tile must be a multiple of 8 from 8 to 128, not 12"),
     ({"layers": 9}, "layers must be 1 to 8, not 9"),
     ({"kind": "raw", "layers": 3}, "layers must be given with layered, not raw"),
     ({"k": 3.0}, "the code layered must stand without settings of statistical"),
     ({"kind": "statistical"}, "k must be above 0 and at most 1000, not 0")],
)  # fmt: skip
def test_settings_out_of_range_are_refused(settings, why):
    with pytest.raises(ValueError, match=why.split(",")[0]):
        StreamCode(**settings)


def test_raw_takes_one_bit_a_pixel_and_cycle(words):
    sent = packets_of(CODES[2], words)
    assert sum(len(p.data) for p in sent) == 4 * words_for(CYCLES) * SHAPE[0] * SHAPE[1]
