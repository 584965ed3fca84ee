"""A port that nobody waits on for longer than was allowed, whatever the board does."""

from __future__ import annotations

import time

from cosim import ViformError
from rtl_model.host.ports import Port

__all__ = ["DeadlinePort", "OutOfTime"]


class OutOfTime(ViformError):
    """The time allowed is over; not a fault of the line by itself."""


class DeadlinePort:
    """A port over another; after `allow(seconds)` everything ends with OutOfTime when these have
    passed by the system's clock. Every loop of a host that talks comes through here, so none can
    go on for ever. `heard`: what has come since the last write."""

    def __init__(self, inner: Port) -> None:
        self.inner, self.name, self.baud = inner, inner.name, inner.baud
        self._end = float("inf")
        self.heard = b""

    def allow(self, seconds: float) -> None:
        """Starts the time anew."""
        self._end = time.monotonic() + seconds

    def read(self, count: int, deadline_s: float) -> bytes:
        """As the port's, and never longer than is left."""
        got = self.inner.read(count, min(deadline_s, self._left()))
        self.heard += got
        return got

    def write(self, data: bytes, deadline_s: float = 1.0) -> None:
        """As the port's, and never longer than is left."""
        self.heard = b""
        self.inner.write(data, min(deadline_s, self._left()))

    def drain(self) -> bytes:
        """As the port's."""
        self._left()
        got = self.inner.drain()
        self.heard += got
        return got

    def set_baud(self, baud: int) -> None:
        """As the port's."""
        self.inner.set_baud(baud)
        self.baud = baud

    def now(self) -> float:
        """As the port's."""
        self._left()
        return self.inner.now()

    def close(self) -> None:
        """As the port's."""
        self.inner.close()

    def _left(self) -> float:
        left = self._end - time.monotonic()
        if left <= 0:
            raise OutOfTime("the time allowed is over")
        return left
