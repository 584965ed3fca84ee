"""Rate control: within the budget and the buffer, least loss first, everything counted."""

from __future__ import annotations

import numpy as np
import pytest

from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import StreamEncoder
from sensor.codec.packets.packet import HEADER, LENGTH, Packet
from sensor.codec.packets.rate import RateControl, SendBuffer
from tests.sensor.codec.packets.streams import steady

SHAPE, CYCLES, GROUP = (48, 64), 1024, 128


@pytest.fixture(scope="module")
def groups():
    """Packets by group: noise on the left half, steady trains on the right."""
    rng = np.random.default_rng(2)
    noise = np.where(np.arange(64) < 32, 0.5, 0.0)
    rate = np.full(SHAPE, 0.31)
    words = steady(rate, rng.random(SHAPE), CYCLES)
    rough = steady(rate, rng.random(SHAPE), CYCLES, 0.5)
    words = np.where(noise > 0, rough, words)
    encoder = StreamEncoder(StreamCode(tile=16), SHAPE)
    sent = encoder.encode(words, 0)
    return [[p for p in sent if p.first == first] for first in range(0, CYCLES, GROUP)]


def run(control, groups):
    """Sends all, with a call a group; [(packet, waited)]."""
    left = []
    for n in range(len(groups) + 10):
        now = (n + 1) * GROUP
        left += control.send(now)
        if n < len(groups):
            control.offer(groups[n], now)
    return left


def test_with_enough_budget_all_is_sent_at_once(groups):
    control = RateControl(1e6, 10**6)
    sent = run(control, groups)
    assert [p for p, _ in sent] == [p for group in groups for p in group]
    assert control.layers_sent == [12 * len(groups)] * 8
    assert control.statistics["dropped_packets"] == control.statistics["dropped_spikes"] == 0


@pytest.mark.parametrize("share", [0.8, 0.5, 0.25, 0.1])
def test_a_lower_budget_is_kept_and_used_and_every_loss_counted(groups, share):
    offered = sum(p.size for group in groups for p in group)
    budget = share * 8 * offered / CYCLES
    control = RateControl(budget, int(budget * 4 * GROUP / 8))
    sent = run(control, groups)
    size = sum(p.size for p, _ in sent)
    stats = control.statistics
    assert stats["offered_bytes"] == offered
    assert stats["sent_bytes"] == size <= budget * CYCLES / 8 + control.buffer.limit / 2
    assert size > 0.9 * budget * CYCLES / 8
    assert control.buffer.peak <= control.buffer.limit
    # Never longer than a full buffer takes, read off once a group.
    assert control.buffer.longest == max(wait for _, wait in sent) <= 4 * GROUP + GROUP
    assert control.layers_sent[0] == 12 * len(groups)
    assert stats["dropped_tiles"] == 0
    kept = sum(p.spikes for p, _ in sent)
    assert stats["dropped_spikes"] == stats["offered_spikes"] - kept > 0
    assert stats["dropped_packets"] == sum(map(len, groups)) - len(sent)
    assert sum(control.layers_sent) == len(sent)


def test_layers_come_from_coarse_to_fine_without_a_gap(groups):
    budget = 4 * sum(p.size for group in groups for p in group) / CYCLES
    sent = {}
    for packet, _ in run(RateControl(budget, int(budget * 2 * GROUP / 8)), groups):
        sent.setdefault((packet.first, packet.tile), []).append(packet.layer)
    assert all(layers == list(range(len(layers))) for layers in sent.values())
    assert len({len(layers) for layers in sent.values()}) > 1


def test_the_midpoints_of_steady_trains_go_first():
    """Of two tiles with layers of one size, that which gains less is cut."""

    def tile(number, gain):
        return [Packet(3, n, number, 0, 128, bytes(80), 10, gain * (n > 0)) for n in range(4)]

    control = RateControl(8 * 100 * 5 / 128, 100)
    control.buffer.limit = 500
    control.budget = (8 * 500 - 4 * 500 / 4) / 128 + 0.1
    left_out = control.offer(tile(0, 1.0) + tile(1, 5.0), 128)
    assert {(p.tile, p.layer) for p in left_out} == {(0, 1), (0, 2), (0, 3)}


def test_a_layer_without_gain_is_sent_where_it_leads_to_one_with_gain():
    gains = (0.0, 0.0, 100.0)
    packets = [Packet(3, n, 0, 0, 128, bytes(80), 0, gain) for n, gain in enumerate(gains)]
    control = RateControl(1e5, 10**4)
    assert control.offer(packets, 128) == []


def test_layer_0_gives_way_only_before_the_buffer_overflows_and_in_turn(groups):
    base = [[p for p in group if p.layer == 0] for group in groups]
    size = max(p.size for group in base for p in group)
    control = RateControl(1.0, 4 * size)
    hit = set()
    for n, packets in enumerate(base):
        now = (n + 1) * GROUP
        control.send(now, bits=8 * 4 * size)  # what there was has left
        left_out = control.offer(packets, now)
        assert 12 - 4 >= len(left_out) > 0
        assert control.buffer.size <= 4 * size
        hit |= {p.tile for p in packets} - {p.tile for p in left_out}
    assert hit == set(range(12))  # every tile has its turn
    assert control.statistics["dropped_tiles"] == control.statistics["dropped_packets"]


def test_a_state_goes_on_to_the_same_packets(groups):
    whole, parts = RateControl(900.0, 30_000), RateControl(900.0, 30_000)
    for n, packets in enumerate(groups):
        now = (n + 1) * GROUP
        expected = [(p.to_bytes(), wait) for p, wait in whole.send(now)]
        assert [(p.to_bytes(), wait) for p, wait in parts.send(now)] == expected
        whole.offer(packets, now)
        parts.offer(packets, now)
        state, parts = parts.state(), RateControl(1.0, 30_000)
        parts.restore(state)
        assert (parts.statistics, parts.layers_sent) == (whole.statistics, whole.layers_sent)


def test_a_buffer_is_first_in_first_out_and_idle_time_is_lost():
    buffer, packets = SendBuffer(100), [Packet(3, 0, n, 0, 32, b"") for n in range(3)]
    assert buffer.send(10_000, 5) == []
    for packet in packets:
        buffer.push(packet, 10)
    assert buffer.size == buffer.peak == 3 * (LENGTH + HEADER)
    assert buffer.send(8 * 20 - 1, 20) == []
    assert buffer.send(1 + 8 * 20, 30) == [(packets[0], 20), (packets[1], 20)]
    assert (buffer.size, buffer.longest) == (20, 20)
    with pytest.raises(ValueError, match="a packet must have at most 80 bytes, not 116"):
        buffer.push(Packet(3, 0, 0, 0, 32, bytes(96)), 30)


@pytest.mark.parametrize(("budget", "size"), [(0.0, 10), (-1.0, 10), (float("nan"), 10), (1.0, 0)])
def test_a_budget_and_a_buffer_must_be_there(budget, size):
    with pytest.raises(ValueError, match="must"):
        RateControl(budget, size)
