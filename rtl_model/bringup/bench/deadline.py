"""A port with a time limit, so that every stage ends."""

from __future__ import annotations

import math

from cosim import ViformError
from rtl_model.host.countdown import Countdown
from rtl_model.host.ether import PacketPort
from rtl_model.host.ports import Port

_COUNTED_S = 10.0  # most of an operation, or of a pause between two, that counts


class OutOfTime(ViformError):
    """The time limit is exceeded, which need not be a fault of the line."""


class Deadline:
    """A time limit; `Port` and socket inherit it.

    Every loop of a stage uses the port, so no loop is endless.

    Attributes:
        inner: the wrapped port.
        name: name for messages.
    """

    def __init__(self, inner: Port | PacketPort) -> None:
        self.inner, self.name = inner, inner.name
        self.allow(math.inf)

    def allow(self, seconds: float) -> None:
        """Sets the time limit, s from now by the system's clock."""
        self._limit = Countdown(seconds, _COUNTED_S)

    def now(self) -> float:
        """Time of the wrapped port, s."""
        self._left()
        return self.inner.now()

    def close(self) -> None:
        """Closes the wrapped port."""
        self.inner.close()

    def _left(self) -> float:
        left = self._limit.left()
        if left <= 0:
            raise OutOfTime("the time limit has passed")
        return left


class DeadlinePort(Deadline):
    """Wraps a port. Every operation after the time limit raises OutOfTime.

    Attributes:
        inner: the wrapped port.
        heard: bytes received since the last write.
    """

    inner: Port

    def __init__(self, inner: Port) -> None:
        super().__init__(inner)
        self.baud = inner.baud
        self.heard = b""

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


class DeadlineSocket(Deadline):
    """Wraps a socket. Every operation after the time limit raises OutOfTime."""

    inner: PacketPort

    def __init__(self, inner: PacketPort) -> None:
        super().__init__(inner)
        self.same_port = inner.same_port

    @property
    def refused(self) -> bool:
        """As `PacketPort`."""
        return self.inner.refused

    @refused.setter
    def refused(self, value: bool) -> None:
        self.inner.refused = value

    def send(self, data: bytes) -> None:
        """As `PacketPort`."""
        self._left()
        self.inner.send(data)

    def receive(self, deadline_s: float) -> bytes | None:
        """As `PacketPort`, limited by the remaining time."""
        return self.inner.receive(min(deadline_s, self._left()))
