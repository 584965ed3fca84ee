"""The send buffer: packets that wait for the link, first in, first out."""

from __future__ import annotations

from collections import deque

import numpy as np

from cosim.stage import State
from sensor.codec.packets.packet import Packet

Sent = tuple[Packet, int]
"""A packet that has left, and the cycles that it has waited."""


class SendBuffer:
    """A queue of a limited number of bytes.

    Attributes:
        limit: bytes that it holds at most.
        size, peak: bytes in it, and the most so far.
        longest: cycles that a packet has waited at most.
    """

    def __init__(self, limit: int) -> None:
        if limit < 1:
            raise ValueError(f"a send buffer must hold bytes, not {limit}")
        self.limit, self.size, self.peak, self.longest = limit, 0, 0, 0
        self._queue: deque[tuple[Packet, int]] = deque()
        self._credit = 0

    @property
    def free(self) -> int:
        """Bytes that it can still take."""
        return self.limit - self.size

    def push(self, packet: Packet, now: int) -> None:
        """Adds a packet at cycle `now`. Raises ValueError where it does not fit."""
        if packet.size > self.free:
            raise ValueError(f"a packet must have at most {self.free} bytes, not {packet.size}")
        self._queue.append((packet, now))
        self.size += packet.size
        self.peak = max(self.peak, self.size)

    def send(self, bits: int, now: int) -> list[Sent]:
        """Packets whose last bit has left by cycle `now`, after the link has carried `bits` more.

        What the link could have carried while there was nothing to send is lost.
        """
        self._credit += bits
        sent = []
        while self._queue and 8 * self._queue[0][0].size <= self._credit:
            packet, since = self._queue.popleft()
            self._credit -= 8 * packet.size
            self.size -= packet.size
            self.longest = max(self.longest, now - since)
            sent.append((packet, now - since))
        if not self._queue:
            self._credit = 0
        return sent

    def state(self) -> State:
        """The packets in it and its counters."""
        data = [packet.to_bytes() for packet, _ in self._queue]
        return {
            "packets": np.frombuffer(b"".join(data), np.uint8).copy(),
            "lengths": np.array([len(one) for one in data], np.int64),
            "since": np.array([since for _, since in self._queue], np.int64),
            "counts": np.array([self.size, self.peak, self.longest, self._credit], np.int64),
        }

    def restore(self, state: State) -> None:
        """Goes on from a state. Spikes and gains of packets, which were used before, are 0."""
        self._queue.clear()
        data, place = state["packets"].tobytes(), 0
        for length, since in zip(state["lengths"], state["since"], strict=True):
            self._queue.append((Packet.of(data[place : place + int(length)]), int(since)))
            place += int(length)
        self.size, self.peak, self.longest, self._credit = (int(n) for n in state["counts"])
