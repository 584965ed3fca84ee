"""Detection of the symbols that come next, while those before are decoded.

Decoding of words, packets and the measurement of the timing use less than all cores. A thread
detects the next symbols meanwhile, as if nothing would be learned from those before. If something
was, its result is dropped and the symbols are detected again: the soft values are the same as
without a thread.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np

from cosim.compute.stopping import threads
from link.detect.detector import Detector, Soft
from link.detect.packed import Packed
from link.receiving.recording import Recording


class Ahead:
    """Soft values of one stretch of symbols after another.

    They are stored in two places by turns, because fresh memory costs as much time as a third of
    the detection. Those that `soft` returned are valid until it is called again.
    """

    def __init__(self) -> None:
        self._thread: ThreadPoolExecutor | None = None
        self._begun: tuple[Detector, int, int, Future[Soft]] | None = None
        self._free: list[Soft] = []
        self._held: Soft | None = None

    @contextmanager
    def running(self) -> Iterator[None]:
        """Has a thread, which is needed for `start`; with the words of one recording at a time."""
        with threads(1, "detector") as self._thread:
            try:
                yield
            finally:
                self.stop()

    def start(self, recording: Recording, detector: Detector, first: int, count: int) -> None:
        """Begins with `count` symbols from `first` on. Until `stop` or `soft` is called, the
        detector must not learn, and the recording must not change."""
        assert self._thread is not None
        self.stop()
        work = self._thread.submit(_detect, recording, detector, first, count, self._room(count))
        self._begun = detector, first, count, work

    def stop(self) -> None:
        """Waits for the thread and drops its result."""
        if self._begun is not None:
            self._keep(self._begun[3].result())
            self._begun = None

    def soft(self, recording: Recording, detector: Detector, first: int, count: int) -> Soft:
        """Soft values of `count` symbols from `first` on, (count, cells)."""
        if self._begun is not None and self._begun[:3] == (detector, first, count):
            out, self._begun = self._begun[3].result(), None
        else:
            self.stop()
            out = _detect(recording, detector, first, count, self._room(count))
        if self._held is not None:
            self._keep(self._held)
        self._held = out
        return out

    def _room(self, count: int) -> Soft | None:
        """Free memory for `count` symbols; None if there is none."""
        room = self._free.pop() if self._free else None
        return room[:count] if room is not None and len(room) >= count else None

    def _keep(self, soft: Soft) -> None:
        self._free.append(soft if soft.base is None else np.asarray(soft.base))


def _detect(
    recording: Recording, detector: Detector, first: int, count: int, out: Soft | None
) -> Soft:
    given = recording.words, recording.first, first, count, recording.stop
    return detector.soft(*given, out) if isinstance(detector, Packed) else detector.soft(*given)
