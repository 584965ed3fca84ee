"""When a clip's frames are shown, read from its packets without decoding any of them.

A container stamps every frame in ticks of its own (Matroska: a millisecond), so that the stamps of
even frames are rounded ones: a frame within a tick of its place at the clip's mean rate is put
there, every other one where its stamp says. Packets come in the order of decoding, which is not
that of showing; a stamp is settled once no packet to come can be shown before it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

from cosim import PS, Clock

__all__ = ["Timeline"]

_TOLD = ("mov,mp4,m4a,3gp,3g2,mj2", "matroska,webm", "avi", "gif", "nut")
"""Containers, as FFmpeg names them, that stamp every packet and lead to a key frame. MPEG program
streams do not: after a jump their frames carry other stamps."""
_HIDDEN_PACKETS = ("vp8",)
"""Codecs that have packets without a visible frame, which the packets do not mark."""


class Timeline:
    """Times of a clip's frames, in picoseconds from frame 0. Frames are numbered in display order.

    The timeline ends at a packet without a stamp, or at the clip's end.

    Attributes:
        uneven: whether a frame so far is not at its place at the mean rate.
    """

    def __init__(self, container: Any, stream: Any, rate: Fraction) -> None:
        self._packets: Iterator[Any] = container.demux(stream)
        self._tick, self._rate = Fraction(stream.time_base), rate
        self._clock = Clock(rate.numerator, rate.denominator)
        self._pending: list[int] = []
        self._stamps: list[int] = []
        self._keys: list[int] = []
        self._edges: list[int] = []
        self._ended = self.uneven = False

    @classmethod
    def opened(cls, path: Path, rate: Fraction) -> Timeline | None:
        """None of a clip whose packets do not tell."""
        import av

        try:
            container = av.open(str(path))
            stream = container.streams.video[0]
            untold = (
                container.format.name not in _TOLD or stream.codec_context.name in _HIDDEN_PACKETS
            )
            if untold or not stream.time_base:
                container.close()
                return None
            return cls(container, stream, rate)
        except (av.FFmpegError, OSError, ValueError, IndexError):
            return None

    def _read(self) -> None:
        """Takes the next packet in."""
        import av

        try:
            packet = next(self._packets)
        except (StopIteration, av.FFmpegError, OSError, ValueError):
            self._settle(None)
            return
        if packet.size == 0 and packet.pts is None:  # the one that flushes a decoder
            return
        if packet.pts is None:
            self._pending.clear()  # whether it is shown before these is not known
            self._settle(None)
            return
        if packet.is_keyframe and not packet.is_discard:
            insort(self._keys, packet.pts)
        if not packet.is_discard:
            insort(self._pending, packet.pts)
        if packet.dts is not None:
            self._settle(packet.dts)

    def _settle(self, before: int | None) -> None:
        """Stamps below `before` come in no later packet; None: no packet comes."""
        self._ended = self._ended or before is None
        n = len(self._pending) if before is None else bisect_right(self._pending, before - 1)
        for stamp in self._pending[:n]:
            self._stamps.append(stamp)
            self._edges.append(self._placed(len(self._edges)))
        del self._pending[:n]

    def _placed(self, n: int) -> int:
        """Where frame n is shown."""
        even = self._clock.edge(n)
        if n == 0:
            return even
        shown = (self._stamps[n] - self._stamps[0]) * self._tick
        at = int(shown * PS)
        if abs(shown - n / self._rate) < self._tick and even > self._edges[-1]:
            return even
        self.uneven = True
        return at if at > self._edges[-1] else self._edges[-1] + self._clock.edge(1)

    def stamp(self, n: int) -> int | None:
        """The stamp of frame n in the stream's ticks; None beyond the end."""
        while len(self._stamps) <= n and not self._ended:
            self._read()
        return self._stamps[n] if n < len(self._stamps) else None

    def edge(self, n: int) -> int:
        """The instant of frame n; beyond the end as if the clip went on at its mean rate."""
        if self.stamp(n) is not None:
            return self._edges[n]
        last = len(self._edges) - 1
        return self._edges[last] + self._clock.edge(n - last)

    def number_at(self, ps: int) -> int:
        """The frame on display at an instant; beyond the end as if the clip went on."""
        while not self._ended and (not self._edges or self._edges[-1] <= ps):
            self._read()
        n = max(bisect_right(self._edges, ps) - 1, 0)
        if n == len(self._edges) - 1 and self._edges:
            n += self._clock.cycle_at(max(ps - self._edges[-1], 0))
        return n

    def number_of(self, stamp: int) -> int | None:
        """The frame with this stamp; None where no settled one has it, or several have."""
        n = bisect_left(self._stamps, stamp)
        return n if self._stamps[n : n + 2].count(stamp) == 1 else None

    def key_before(self, n: int) -> int | None:
        """The stamp of the last frame up to n from which decoding can begin."""
        stamp = self.stamp(n)
        at = len(self._keys) if stamp is None else bisect_right(self._keys, stamp)
        return self._keys[at - 1] if at else None
