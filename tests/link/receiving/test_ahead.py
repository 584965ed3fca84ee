"""Detection ahead: what is returned, when the thread's result is dropped, and whose memory."""

from types import SimpleNamespace

import numpy as np
import pytest

from link.receiving.ahead import Ahead

RECORDING = SimpleNamespace(words=np.zeros((1, 2, 2), np.uint32), first=0, stop=32)


class Counter:
    """A detector whose soft values are the symbols' numbers plus what it has learned."""

    def __init__(self) -> None:
        self.learned, self.calls = 0.0, []

    def soft(self, words, start, first, count, stop):
        self.calls.append(first)
        symbol = np.arange(first, first + count, dtype=np.float32)[:, None]
        return symbol + np.float32(self.learned) + np.zeros((1, 3), np.float32)


def test_symbols_are_detected_once_if_nothing_changes():
    ahead, detector = Ahead(), Counter()
    with ahead.running():
        for first in range(0, 40, 8):
            soft = ahead.soft(RECORDING, detector, first, 8)
            ahead.start(RECORDING, detector, first + 8, 8)
            assert soft.shape == (8, 3) and (soft[:, 0] == np.arange(first, first + 8)).all()
    assert detector.calls == list(range(0, 48, 8))


def test_symbols_are_detected_again_after_a_change():
    ahead, detector = Ahead(), Counter()
    with ahead.running():
        ahead.start(RECORDING, detector, 8, 8)
        ahead.stop()
        detector.learned = 100.0
        assert ahead.soft(RECORDING, detector, 8, 8)[0, 0] == 108
        ahead.start(RECORDING, detector, 16, 8)
        assert len(ahead.soft(RECORDING, detector, 16, 4)) == 4  # fewer than begun
        ahead.start(RECORDING, detector, 24, 8)
        assert ahead.soft(RECORDING, Counter(), 24, 8)[0, 0] == 24  # another detector
    assert detector.calls == [8, 8, 16, 16, 24]


def test_a_fault_of_the_detector_is_that_of_the_caller():
    ahead = Ahead()
    broken = SimpleNamespace(soft=lambda *given: 1 / 0)
    with pytest.raises(ZeroDivisionError), ahead.running():
        ahead.start(RECORDING, broken, 0, 8)
        ahead.soft(RECORDING, broken, 0, 8)
