"""A stream of packets through blocks: order, losses, late beginning, checkpoints."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from link.coding.stream_boxes import (
    LONGEST_PACKET,
    PacketParser,
    StreamFrame,
    StreamInbox,
    StreamOutbox,
    read_stream_frame,
    stream_blocks,
    stream_rate,
    with_length,
    write_stream_frame,
)
from link.layout import Layout
from link.mode import Mode
from tests.link.coding.soft import soft_of

SMALL = Layout(Mode(128, 128, 4, 2, "8b10b", 32))


def packets_of(seed: int, count: int, longest: int = 400) -> list[bytes]:
    rng = np.random.default_rng(seed)
    return [rng.bytes(int(size)) for size in rng.integers(0, longest, count)]


def outbox_of(packets: list[bytes], blocks: int) -> StreamOutbox:
    waiting = iter(packets)
    return StreamOutbox(stream_blocks(SMALL), blocks, lambda block: next(waiting, None))


def enough(packets: list[bytes]) -> int:
    """Blocks that carry all packets, and one empty one."""
    return sum(len(p) + 4 for p in packets) // stream_rate(stream_blocks(SMALL)) + 2


@pytest.mark.parametrize("longest", [3, 400, 5000])
def test_packets_arrive_in_order_and_whole(longest: int) -> None:
    packets = packets_of(1, 60, longest)
    outbox = outbox_of(packets, enough(packets))
    inbox = StreamInbox(SMALL)
    for group in range(outbox.groups):
        inbox.put(group, soft_of(SMALL, outbox.values(group)))
    assert [a.packet for a in inbox.arrivals] == packets
    assert inbox.frames_right == inbox.frames_read == outbox.frames and inbox.frames_lost == 0
    groups = [a.group for a in inbox.arrivals]
    assert groups == sorted(groups)


def test_a_lost_block_loses_only_packets_that_touch_it() -> None:
    packets = packets_of(2, 200)
    outbox, inbox = outbox_of(packets, enough(packets)), StreamInbox(SMALL)
    each = stream_blocks(SMALL).groups
    lost = range(3 * each, 5 * each)
    for group in range(outbox.groups):
        values = outbox.values(group)
        if group in lost:
            rng = np.random.default_rng(group)
            values = rng.integers(0, 256, SMALL.cells, dtype=np.uint8)
        inbox.put(group, soft_of(SMALL, values))
    size = stream_rate(stream_blocks(SMALL))
    ends = np.cumsum([len(p) + 4 for p in packets])
    begins = ends - [len(p) + 4 for p in packets]
    whole = (ends <= 3 * size) | (begins >= 5 * size)
    assert [a.packet for a in inbox.arrivals] == [
        p for p, good in zip(packets, whole, strict=True) if good
    ]
    assert inbox.frames_lost == 2 * stream_blocks(SMALL).frames


def test_a_receiver_that_joins_a_period_late_reads_on() -> None:
    """It knows the number of a group only modulo the pilots' period."""
    period = stream_blocks(SMALL).period
    assert period is not None
    packets = packets_of(3, 2500)
    outbox, inbox = outbox_of(packets, enough(packets)), StreamInbox(SMALL)
    assert outbox.groups > period + 10
    for group in range(outbox.groups):
        if group >= period + 4:
            inbox.put(group - period, soft_of(SMALL, outbox.values(group)))
        else:
            outbox.values(group)
    got = [a.packet for a in inbox.arrivals]
    assert len(got) > 20 and got == packets[-len(got) :]


def test_a_restored_outbox_sends_the_same() -> None:
    packets = packets_of(4, 300)
    whole, blocks = outbox_of(packets, enough(packets)), enough(packets)
    waiting = iter(packets)
    first = StreamOutbox(stream_blocks(SMALL), blocks, lambda block: next(waiting, None))
    half = whole.groups // 2
    for group in range(half):
        assert np.array_equal(first.values(group), whole.values(group))
    again = StreamOutbox(stream_blocks(SMALL), blocks, lambda block: next(waiting, None))
    again.restore(first.state())
    for group in range(half - 2, whole.groups):
        expected = outbox_values(packets, blocks, group)
        assert np.array_equal(again.values(group), expected)


def outbox_values(packets: list[bytes], blocks: int, group: int) -> np.ndarray:
    outbox = outbox_of(packets, blocks)
    for before in range(group):
        outbox.values(before)
    return outbox.values(group)


def test_blocks_are_made_in_order() -> None:
    outbox = outbox_of([], 9)
    with pytest.raises(ValueError, match="block must be 0, not 5"):
        outbox.values(5 * stream_blocks(SMALL).groups)


@given(st.binary(max_size=300))
def test_garbage_is_no_frame(data: bytes) -> None:
    assert read_stream_frame(np.frombuffer(data, np.uint8)) is None


@given(st.lists(st.tuples(st.integers(0, 40), st.binary(max_size=60), st.integers(0, 70))))
def test_frames_of_any_content_do_no_harm(frames: list[tuple[int, bytes, int]]) -> None:
    """Lengths that cannot be, places that lie anywhere: packets or none, never an exception."""
    row = PacketParser()
    for number, piece, begin in frames:
        where = begin if begin < len(piece) else None
        frame = read_stream_frame(write_stream_frame(StreamFrame(number, piece, where), 90))
        assert frame == StreamFrame(number, piece, where)
        for packet in row.put(frame):
            assert isinstance(packet, bytes)


def test_a_packet_beyond_the_limit_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 16777216 bytes, not 16777217"):
        with_length(bytes(LONGEST_PACKET + 1))
    row = PacketParser()
    assert row.put(StreamFrame(0, (LONGEST_PACKET + 1).to_bytes(4, "little") + b"abc", 0)) == []
    assert row.put(StreamFrame(1, with_length(b"next"), 0)) == [b"next"]
