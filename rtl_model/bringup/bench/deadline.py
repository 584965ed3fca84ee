"""A port with a time limit, so that every stage ends."""

from __future__ import annotations

import time

from cosim import ViformError
from rtl_model.host.ports import Port

__all__ = ["DeadlinePort", "OutOfTime"]


class OutOfTime(ViformError):
    """The time limit is exceeded, which need not be a fault of the line."""


class DeadlinePort:
    """Wraps a port. Every operation after the time limit raises OutOfTime.

    Every loop of a stage uses the port, so no loop is endless.

    Attributes:
        inner: the wrapped port.
        heard: bytes received since the last write.
    """

    def __init__(self, inner: Port) -> None:
        self.inner, self.name, self.baud = inner, inner.name, inner.baud
        self._end = float("inf")
        self.heard = b""

    def allow(self, seconds: float) -> None:
        """Sets the time limit, s from now by the system's clock."""
        self._end = time.monotonic() + seconds

    def read(self, count: int, deadline_s: float) -> bytes:
        """As `Port`, limited by the remaining time."""
        got = self.inner.read(count, min(deadline_s, self._left()))
        self.heard += got
        return got

    def write(self, data: bytes, deadline_s: float = 1.0) -> None:
        """As `Port`, limited by the remaining time."""
        self.heard = b""
        self.inner.write(data, min(deadline_s, self._left()))

    def drain(self) -> bytes:
        """As `Port`."""
        self._left()
        got = self.inner.drain()
        self.heard += got
        return got

    def set_baud(self, baud: int) -> None:
        """As `Port`."""
        self.inner.set_baud(baud)
        self.baud = baud

    def now(self) -> float:
        """As `Port`."""
        self._left()
        return self.inner.now()

    def close(self) -> None:
        """As `Port`."""
        self.inner.close()

    def _left(self) -> float:
        left = self._end - time.monotonic()
        if left <= 0:
            raise OutOfTime("the time limit has passed")
        return left
