"""Ticks that a recording lacks: found by the pilots, put in, and erased from the data."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Viform
from link.layout import pilots
from link.mode import Mode
from link.receiving.pilots.sequence import PilotSignal, missing_ticks, sequence_values
from link.receiving.receiver import Receiver
from link.receiving.recording import Gap, Recording
from link.verdict import Cause
from tests.link.receiving.test_receiving import DATA, receive
from tests.link.receiving.toy import CLOCK, Toy, small

ONE_TICK = Mode(256, 256, 2, 1, "scrambled", None, rate=0.75)


def shown(
    ticks: int, first: float, period: float, noise: float = 0.05, begin: int = 100
) -> PilotSignal:
    """Pilots that fire as often as they are lit, in four bands of rows."""
    rng = np.random.Generator(np.random.Philox(key=6))
    share = (1 + sequence_values(np.array(first), period, np.arange(ticks) + 0.0)) / 2
    bits = share[:, None] + noise * rng.standard_normal((ticks, 4))
    return PilotSignal(begin, bits, np.arange(4) * 15.0, np.full(4, 20))


def without(signal: PilotSignal, place: int, count: int) -> PilotSignal:
    """The same, and `count` ticks from a place on are missing."""
    bits = np.delete(signal.bits, slice(place, place + count), axis=0)
    return PilotSignal(signal.first, bits, signal.rows, signal.pixels)


@pytest.mark.parametrize("period", [1.0, 2.0])
@pytest.mark.parametrize("phase", [0.0, 0.3])
@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("symbols", [58, 300])
def test_a_gap_is_found_where_the_pilots_tell(
    period: float, phase: float, count: int, symbols: int
) -> None:
    ticks = int(symbols * period)
    signal = shown(ticks, phase, period)
    state = pilots()[np.arange(ticks) // int(period)]
    for place in range(12, ticks - 12 - count, ticks // 12):
        got = missing_ticks(without(signal, place, count), period, (100, 100 + ticks - count))
        if got is None:  # 25 symbols on each side are too few to number them
            assert symbols == 58 and count > 1 and abs(place - ticks / 2) < ticks / 6
            continue
        assert got.count == count and got.tick <= 100 + place <= got.last
        # While the pilots repeat what they showed, and a tick or two more by chance.
        low = high = place
        while state[low - 1] == state[low - 1 + count]:
            low -= 1
        while high + count < ticks and state[high] == state[high + count]:
            high += 1
        if symbols == 58 and count > 1:
            continue  # found, with a wider range of places where one side is short
        assert low - 2 <= got.tick - 100 and got.last - 100 <= high + 2


@pytest.mark.parametrize("drift", [0.0, 400e-6, 2000e-6, 0.016])
@pytest.mark.parametrize("ticks", [58, 300, 1100])
def test_no_gap_is_found_in_a_whole_recording(drift: float, ticks: int) -> None:
    """Whatever the clock: one that is 1.6 % off loses a tick in 58."""
    for first in (0.0, 0.4, -3.7):
        for noise in (0.05, 0.3):
            signal = shown(ticks, first, 1 + drift, noise)
            assert missing_ticks(signal, 1.0, (100, 100 + ticks)) is None


def test_no_gap_is_found_in_chance_or_darkness() -> None:
    rng = np.random.Generator(np.random.Philox(key=3))
    for bits in (rng.random((200, 4)), np.zeros((200, 4))):
        signal = PilotSignal(0, bits, np.arange(4) * 15.0, np.full(4, 20))
        assert missing_ticks(signal, 1.0, (0, 200)) is None


@pytest.mark.parametrize("place", [0, 1, 30, 31, 32, 45, 63, 64, 69])
@pytest.mark.parametrize("count", [1, 3, 8])
def test_ticks_are_put_in(place: int, count: int) -> None:
    rng = np.random.Generator(np.random.Philox(key=9))
    planes = rng.random((100, 3, 5)) < 0.5
    first = Viform.from_planes(planes[:70], CLOCK)
    later = Viform.from_planes(planes[70:], CLOCK)
    recording = Recording((3, 5))
    recording.add(Viform(first.words, 70, CLOCK, 40))
    recording.put_in(Gap(40 + place, count, 40 + place))
    assert recording.stop == 110 + count
    recording.add(Viform(later.words, 30, CLOCK, 110))  # the camera goes on to count its own
    rows, columns = (a.ravel() for a in np.indices((3, 5)))
    got = recording.pixels(rows, columns).reshape(-1, 3, 5)
    assert np.array_equal(got, np.insert(planes, [place] * count, False, axis=0))
    with pytest.raises(ValueError, match="must be in 40"):
        recording.put_in(Gap(39, 1, 39))


@pytest.fixture(scope="module")
def short() -> Toy:
    """A file of one block: 48 symbols of training, 8 of data."""
    toy = small(DATA[:2000], ONE_TICK, first=14.02, overhead=0.0)
    assert toy.sent.planes == 58
    return toy


@pytest.mark.slow
@pytest.mark.parametrize("lost", [20, 38, 50, 56, 62, 64, 68])
def test_a_file_of_one_block_arrives_without_one_of_its_ticks(short: Toy, lost: int) -> None:
    """In the training, and in the block, of which the tick is an eighth."""
    got = receive(short, np.delete(short.planes(), lost, axis=0))
    assert got.verdict.whole, got.verdict
    assert got.delivered is not None and got.delivered[0] == DATA[:2000]
    assert got.codewords_wrong == 0  # of all places that may be, the right one was read


@pytest.mark.slow
def test_more_than_the_code_can_mend_is_an_interruption(short: Toy) -> None:
    planes = np.delete(short.planes(), slice(63, 66), axis=0)
    receiver = Receiver(planes.shape[1:])
    receiver.step(Viform.from_planes(planes, CLOCK))
    got = receiver.finish()
    assert got.verdict.cause is Cause.INTERRUPTED, got.verdict
    assert "3 ticks early" in got.verdict.text and not got.delivered
