"""Ancillary data as packets: they come back as they were, survive loss, late listeners and damage,
and go on from a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.spikes.ancillary import Ancillary, ChargePlane, RegisterWrite
from cosim.stage import BLOCK, blocks
from scenarios.assemble.behind.link.coding import Decoder, Sender
from sensor.codec.packets.ancillary import CHARGES, WRITE, AncillaryDecoder, AncillaryEncoder
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.packet import Packet, Tiles
from sensor.codec.packets.rate import RateControl

SHAPE = (20, 70)
CODE = StreamCode("layered", 96, 32)
CYCLES = 480
RANDOM = np.random.default_rng(8)


def charge(cycle: int) -> ChargePlane:
    gain = np.random.default_rng(cycle).integers(0, 301, SHAPE, dtype=np.uint16)
    return ChargePlane(cycle, 50, gain, 300)


SAID: list[Ancillary] = [
    RegisterWrite(0, 0.75, (0, 20)), charge(50), RegisterWrite(95, 0.5, (3, 20)),
    RegisterWrite(96, 0.4375, (3, 11)), charge(100), charge(250), RegisterWrite(300, 2.0, (0, 20)),
    charge(350),
]  # fmt: skip


def same(one: Sequence[Ancillary], other: Sequence[Ancillary]) -> bool:
    return len(one) == len(other) and all(
        a == b if isinstance(a, RegisterWrite) else isinstance(b, ChargePlane)
        and (a.cycle, a.span, a.levels) == (b.cycle, b.span, b.levels)
        and np.array_equal(a.gain, b.gain)
        for a, b in zip(one, other, strict=True)
    )  # fmt: skip


def sender(budget: float = 1e6, buffer: int = 200_000) -> Sender:
    return Sender(CODE, SHAPE, CYCLES, RateControl(budget, buffer))


def block(first: int, cycles: int) -> Viform:
    words = np.random.default_rng(first).integers(0, 2**32, (-(-cycles // 32), *SHAPE), np.uint32)
    told = tuple(each for each in SAID if first <= each.cycle < first + cycles)
    return Viform(words, cycles, Clock(40_000), first, told)


def sent(made: Sender, first: int = 0) -> list[bytes]:
    packets = []
    for each in blocks(CYCLES, BLOCK):
        if each.start >= first:
            made.put(block(each.start, each.cycles))
        while (packet := made.pop(each.stop)) is not None:
            packets.append(packet)
    while (packet := made.pop(CYCLES + CODE.cycles)) is not None:  # of the last, shorter groups
        packets.append(packet)
    return packets


def heard(packets: Sequence[bytes], step: int = 64) -> list[Ancillary]:
    decoder, found = Decoder(CODE, SHAPE, CYCLES), list[Ancillary]()
    for packet in packets:
        decoder.take(packet)
    for stop in range(step, CYCLES + step, step):
        found += decoder.read(min(stop, CYCLES))[3]
    return found


@pytest.mark.parametrize("phases", [1, 3])
def test_what_was_said_comes_back(phases: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where tiles end their packets at instants of their own."""
    monkeypatch.setattr(f"{__name__}.CODE", replace(CODE, phases=phases))
    made = sender()
    packets = sent(made)
    assert same(heard(packets), SAID) and same(heard(packets, 32), SAID)
    said = [p for p in map(Packet.of, packets) if p.code in (WRITE, CHARGES)]
    # The registers once more in each group, unless they are written in its first cycle.
    assert sum(p.code == WRITE for p in said) == 4 + 3
    assert sum(p.code == CHARGES for p in said) == 4 * len(Tiles(SHAPE, 32))
    assert made.counts.ancillary_bytes == sum(p.size for p in said)
    order = list(RANDOM.permutation(len(packets)))
    assert same(heard([packets[n] for n in order]), SAID)


def test_a_listener_that_joins_late_knows_the_registers_with_the_next_group() -> None:
    packets = sent(sender())
    late = [p for p in packets if Packet.of(p).first >= 192]
    found = heard(late)
    assert same(found, [RegisterWrite(192, 0.4375, (3, 11)), *SAID[5:]])
    # A write that is lost comes with the next group.
    lost = [p for p in packets if not (Packet.of(p).code == WRITE and Packet.of(p).first == 288)]
    writes = [each for each in heard(lost) if isinstance(each, RegisterWrite)]
    assert writes[-1] == RegisterWrite(384, 2.0, (0, 20)) and len(writes) == 4


def test_a_tile_of_charges_that_is_lost_shows_none() -> None:
    packets = [
        p for p in sent(sender())
        if not (Packet.of(p).code == CHARGES and Packet.of(p).tile == 1)
    ]  # fmt: skip
    found = [each for each in heard(packets) if isinstance(each, ChargePlane)]
    assert len(found) == 4
    for each in found:
        expected = charge(each.cycle).gain.copy()
        expected[:, 32:64] = 0
        np.testing.assert_array_equal(each.gain, expected)


def test_both_ends_go_on_from_a_state() -> None:
    packets = sent(sender())
    for cut in (64, 128, 320):
        first, second = sender(), sender()
        got = []
        for each in blocks(CYCLES, BLOCK):
            if each.start == cut:
                second.restore(first.state())
                first = second
            first.put(block(each.start, each.cycles))
            while (packet := first.pop(each.stop)) is not None:
                got.append(packet)
        assert got == packets and first.counts.ancillary_bytes > 0
        one, other = Decoder(CODE, SHAPE, CYCLES)._decoder, Decoder(CODE, SHAPE, CYCLES)._decoder
        for packet in packets:
            one.take(packet)
        found = list(one.read(cut).ancillary)
        other.restore(one.state())
        assert same([*found, *other.read(CYCLES).ancillary], SAID)


def test_charges_leave_half_of_the_buffer_to_the_spikes() -> None:
    made = sender(buffer=2000)
    packets = [Packet.of(p) for p in sent(made)]
    assert made.counts.ancillary_dropped > 0
    # Registers come first, and are never left out.
    assert sum(p.code == WRITE for p in packets) == 7


def test_damaged_packets_are_refused() -> None:
    tiles = Tiles(SHAPE, 32)
    encoder, decoder = AncillaryEncoder(tiles), AncillaryDecoder(tiles)
    encoder.take(SAID)
    whole = encoder.group(0, 96)
    assert all(decoder.take(packet) for packet in whole)
    random = np.random.default_rng(1)
    for packet in whole:
        for _ in range(40):
            data = bytearray(packet.data)
            for at in random.integers(0, len(data), 2):
                data[at] = random.integers(0, 256)
            cut = bytes(data[: random.integers(0, len(data) + 1)])
            fresh = AncillaryDecoder(tiles)
            if fresh.take(Packet(packet.code, 0, packet.tile, 0, 96, cut)):
                for said in fresh.read(0, 96):
                    assert 0 <= said.cycle < 96
                    assert not isinstance(said, ChargePlane) or said.gain.max() <= said.levels
    far = Packet(CHARGES, 0, 99, 0, 96, whole[-1].data)
    assert not decoder.take(far)
