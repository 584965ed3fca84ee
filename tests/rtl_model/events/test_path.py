"""The event path's cycle models against the Python coder: every packet, every spike, every loss."""

import numpy as np
import pytest

from rtl_model.events.encoder import EventEncoder, EventSize
from rtl_model.events.rates import steady_words, tiles_of
from tests.rtl_model.events.decoder import EventDecoder
from tests.rtl_model.events.path import Light, packets_in, random_ready, run
from tests.sensor.codec.packets.told import gaps_of

SQUARE = EventSize()
WIDE = EventSize(128, 128, 64, depth=1024, tile=70_000)
DIM, BRIGHT = Light(0.034), Light(0.3)


def same(result, pixels):
    assert result.failure == ""
    assert result.pixels >= pixels
    assert result.packets > 0


def test_a_hundred_million_pixel_cycles_of_dim_light():
    """At .034 spikes a cycle nothing is lost, although the receiver is ready in 60 % of clocks."""
    result = run(SQUARE, DIM, 1e8)
    same(result, 1e8)
    assert result.packets * SQUARE.pixels * SQUARE.cycles == result.pixels
    assert (result.gaps, result.lost_rows, result.lost_spikes, result.missing) == (0, 0, 0, 0)
    assert 0.03 < result.spikes / result.pixels < 0.04


def test_ten_million_pixel_cycles_of_light_that_overflows():
    result = run(SQUARE, BRIGHT, 1e7)
    same(result, 1e7)
    assert result.gaps > result.packets > 10
    assert 0.1 < result.lost_spikes / result.spikes < 0.9
    assert result.lost_rows > result.gaps


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "light", "slack"),
    [
        (SQUARE, DIM, 0), (SQUARE, BRIGHT, 0), (SQUARE, Light(0.3, ready=1), 1100),
        (WIDE, Light(0.01), 0), (WIDE, Light(0.034, ready=0.9), 0),
        (EventSize(64, 100, 32, 64, 512), Light(0.1), 0),
    ],
)  # fmt: skip
def test_a_thousand_million_pixel_cycles(size, light, slack):
    same(run(size, light, 2e8, slack=slack, seed=100), 2e8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize(
    "size",
    [
        EventSize(1, 1, 32, 128, 16), EventSize(7, 40, 32, 64, 16), EventSize(3, 128, 64, 32, 16),
        EventSize(128, 1, 32, 32, 32), EventSize(2, 33, 64, 128, 16, 2**32 - 1),
    ],
)  # fmt: skip
def test_small_arrays(size, seed):
    rng = np.random.default_rng(seed)
    ready = rng.uniform(0.2, 1)
    light = Light(rng.choice([0.002, 0.05, 0.3, 1.2]), rng.random(), rng.random(), ready)
    same(run(size, light, 40 * size.pixels * size.cycles, slack=seed, seed=seed), 1)


def test_a_stream_that_begins_within_a_group_says_so():
    words = steady_words(SQUARE, 256, 0.1, 0.5, 0.2, 1)
    tick = SQUARE.tick_minimum
    tiles = tiles_of(words, SQUARE, tick)[40 * 32 + 5 :]
    (packet,) = packets_in(EventEncoder(SQUARE).run(tiles, np.ones(200 * tick, np.uint8)))
    assert (packet.first, gaps_of(packet.data, 128)) == (0, [(0, 0, 40, 5)])


def test_frames_that_fall_back_begin_a_new_packet():
    """After `sensor_clear` the array counts frames from 0; a row is lost to say so."""
    words = steady_words(SQUARE, 288, 0.03, 0.5, 0.2, 1)
    tick = SQUARE.tick_minimum
    before = tiles_of(words[:2], SQUARE, tick)[: 50 * 32]
    after = tiles_of(words, SQUARE, tick, 0, 50 * tick)
    encoder = EventEncoder(SQUARE)
    ready = np.ones(350 * tick, np.uint8)
    words_out = encoder.run(np.concatenate([before, after]), ready)
    packets = packets_in(words_out[: np.flatnonzero(words_out["last"])[-1] + 1])
    said = [(packet.first, gaps_of(packet.data, 128)) for packet in packets]
    assert said == [(0, [(50, 0, 128, 0)]), (0, [(0, 0, 0, 1)]), (128, [])]
    assert encoder.lost_rows == 1


def test_a_receiver_that_stops_makes_gaps_and_then_all_goes_on():
    words = steady_words(SQUARE, 128 * 8, 0.034, 0.5, 0.2, 1)
    tick = SQUARE.tick_minimum
    ready = np.ones(128 * 8 * tick, np.uint8)
    ready[200 * tick : 600 * tick] = 0
    encoder = EventEncoder(SQUARE)
    out = encoder.run(tiles_of(words, SQUARE, tick), ready)
    packets = packets_in(out[: np.flatnonzero(out["last"])[-1] + 1])
    assert [packet.first for packet in packets] == [0, 128, 512, 640, 768]  # 256 and 384 are lost
    told = [gaps_of(packet.data, 128) for packet in packets]
    assert [len(gaps) for gaps in told] == [0, 1, 1, 0, 0]
    assert told[1][0][2:] == (128, 0)
    assert told[2][0][:2] == (0, 0)
    assert encoder.lost_rows > 32 * 350


def test_damaged_packets_give_nothing_and_are_counted():
    words = steady_words(SQUARE, 128 * 12, 0.05, 0.5, 0.2, 1)
    tick = SQUARE.tick_minimum
    out = EventEncoder(SQUARE).run(
        tiles_of(words, SQUARE, tick), np.ones(128 * 12 * tick, np.uint8)
    )
    ends = np.flatnonzero(out["last"]) + 1
    halves = out[: ends[-1]].copy()
    rng = np.random.default_rng(1)
    for n in range(1, len(ends), 2):  # every second one
        at = rng.integers(ends[n - 1], ends[n])
        halves["data"][at] ^= np.uint16(1 << rng.integers(16))
    decoder, always = EventDecoder(SQUARE), np.ones(1, np.uint8)
    got = decoder.run(halves, always, always, 10**7, 50_000).words
    assert (decoder.packets, decoder.damaged) == (6, 5)
    parts = words.reshape(12, -1)[: len(ends) : 2]
    assert np.array_equal(got["data"].reshape(6, -1), parts)


def test_a_light_has_the_rate_that_is_asked_for():
    """The mean of rates spread evenly about `rate`; of n pixel-cycles it is off by at most a spike
    a pixel, and by the spread over the root of the pixels."""
    words = steady_words(SQUARE, 3200, 0.1, 0.5, 0.3, 1)
    mean = np.bitwise_count(words).mean() / 32
    assert abs(mean - 0.1) < 5 * 0.1 * 0.5 / np.sqrt(3 * SQUARE.pixels) + 1 / 3200
    ready = random_ready(10**6, 0.6, 1)
    assert 0.57 < ready.mean() < 0.61
