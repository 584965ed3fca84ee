"""Packets through light: all of them, around an occlusion, and from the middle on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cosim import Viform
from cosim.stage import blocks
from link.coding.stream_boxes import StreamOutbox, stream_blocks
from link.layout import Layout
from link.mode import Mode
from link.receiving.packets import PacketReceiver
from link.sending import Transmission
from tests.link.receiving.toy import CLOCK, Toy, homography

MODE = Mode(256, 256, 2, 2, "8b10b", 32)
PACKETS = [np.random.default_rng(n).bytes(300 + 7 * n) for n in range(400)]


def stream_toy(count: int, **given: object) -> tuple[Toy, list[bytes]]:
    """A toy that sends packets for `count` blocks, and the packets that it takes."""
    waiting, taken = iter(PACKETS), []

    def ready(block: int) -> bytes | None:
        packet = next(waiting, None)
        if packet is not None:
            taken.append(packet)
        return packet

    sent = Transmission(MODE, StreamOutbox(stream_blocks(Layout(MODE)), count, ready))
    shape = (300, 300)
    at = homography(MODE, shape, 1.02, 0.4, 0.01, (1.3, -0.6))
    return Toy(sent, shape, at, 14 + sent.planes + 16, **given), taken  # type: ignore[arg-type]


def received(
    planes: np.ndarray, spoil: Callable[[np.ndarray], None] = lambda planes: None
) -> tuple[list[tuple[int, bytes]], PacketReceiver]:
    spoil(planes)
    receiver = PacketReceiver(planes.shape[1:], len(planes))
    got = []
    for block in blocks(len(planes)):
        words = Viform.from_planes(planes[block.start : block.stop], CLOCK).words
        got += receiver.step(Viform(words, block.cycles, CLOCK, block.start))
    return got, receiver


def test_all_packets_arrive_with_the_tick_of_their_light() -> None:
    toy, taken = stream_toy(9)
    got, receiver = received(toy.planes())
    # The last packet may continue beyond the last block.
    assert [packet for _, packet in got] == taken[: len(got)] and len(got) >= len(taken) - 1
    assert receiver.received is not None and receiver.known == toy.cycles
    assert receiver.received.frames_right == receiver.received.frames_read > 0
    ticks = np.array([tick for tick, _ in got])
    assert (np.diff(ticks) >= 0).all()
    form = stream_blocks(toy.layout)
    first = toy.first + (48 + form.groups * toy.layout.group) * toy.period
    assert abs(ticks[0] - first) <= 2


@pytest.mark.slow
def test_an_occlusion_loses_its_own_packets_and_no_others() -> None:
    toy, taken = stream_toy(40)

    def hide(planes: np.ndarray) -> None:
        planes[400:520] = False

    got, receiver = received(toy.planes(), hide)
    packets = [packet for _, packet in got]
    assert set(packets) <= set(taken) and packets == [p for p in taken if p in set(packets)]
    ((low, high),) = receiver.interruptions
    assert 380 <= low <= 400 and 520 <= high <= 540
    assert receiver.frames_lost > 0 and len(packets) > 0.6 * len(taken)
    late = [packet for tick, packet in got if tick > 600]
    assert late and late == taken[taken.index(late[0]) : taken.index(late[0]) + len(late)]


@pytest.mark.slow
def test_a_receiver_that_joins_in_the_middle_reads_on() -> None:
    toy, taken = stream_toy(40)
    planes = toy.planes()[333:]
    got, _ = received(planes)
    packets = [packet for _, packet in got]
    assert len(packets) > 0.4 * len(taken)
    assert packets == taken[taken.index(packets[0]) : taken.index(packets[0]) + len(packets)]
