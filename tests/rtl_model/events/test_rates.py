"""What an event path carries, beside closed forms."""

import pytest

from rtl_model.events.encoder import EventSize
from rtl_model.events.rates import measure, most_rate

SIZE = EventSize()


def test_dim_pixels_have_one_and_a_half_events_a_spike():
    """At a spike in 333 to 1000 cycles a packet of 128 has at most one spike of a pixel. It comes
    at any cycle t alike, with width t + 1; a closing one follows where t + t + 1 < 128, half of
    them."""
    got = measure(SIZE, 0.002, 1200)
    spikes = got.rate * SIZE.pixels * SIZE.cycles * 24
    assert got.sent == pytest.approx(1.5, abs=5 * 0.5 / spikes**0.5)
    assert got.lost == 0
    least = 16 * (got.sent * got.rate + 8 / (SIZE.pixels * SIZE.cycles))  # without row words
    assert least < got.bits < least + 16 * got.sent * got.rate


def test_a_channel_carries_at_most_a_spike_a_clock():
    """164 clocks a cycle serve at most 164 of 1024 pixels."""
    tick = SIZE.tick_minimum
    most = most_rate(SIZE, tick)
    assert 0.3 * tick / SIZE.pixels < most < tick / SIZE.pixels
    over = measure(SIZE, 0.5, tick)
    assert over.lost > 1 - tick / SIZE.pixels / 0.5
    assert over.bits < 16 * tick / SIZE.pixels


def test_one_pixel_never_overflows():
    assert most_rate(EventSize(1, 1, depth=16), 9) == 1 - 1 / 256
