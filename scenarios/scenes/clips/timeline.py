"""Reads the presentation times of a clip's frames from its packets, without decoding them.

A container stamps frames in ticks (Matroska: 1 ms), so the stamps of evenly spaced frames are
rounded. A frame within one tick of its time at the mean rate gets that time; every other frame gets
the time of its stamp. Packets are in decoding order, which differs from presentation order; a stamp
is final as soon as no later packet can precede it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

from cosim import PS, Clock
from scenarios.scenes.clips.fitted import DECODING

_STAMPED = ("mov,mp4,m4a,3gp,3g2,mj2", "matroska,webm", "avi", "gif", "nut", "apng")
"""Containers, by their names in FFmpeg, that stamp every packet and support seeks to key frames.
Not MPEG program streams: after a seek their frames have other stamps."""
_HIDDEN_PACKETS = ("vp8",)
"""Codecs with packets of invisible frames that are not marked."""


class Timeline:
    """Times of a clip's frames from frame 0, ps. Frames are numbered in presentation order.

    The timeline ends at a packet without a stamp, or at the end of the clip.

    Attributes:
        uneven: whether any frame so far differs from its time at the mean rate.
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
    def opened(cls, path: Path, rate: Fraction, index: int) -> Timeline | None:
        """The timeline of the stream `index` of a clip; None if its packets have no usable
        stamps."""
        import av

        try:
            container = av.open(str(path), options=DECODING)
            stream = container.streams[index]
            stamped = (
                container.format.name in _STAMPED
                and stream.codec_context.name not in _HIDDEN_PACKETS
            )
            if not stamped or not stream.time_base:
                container.close()
                return None
            return cls(container, stream, rate)
        except (av.FFmpegError, OSError, ValueError, IndexError):
            return None

    def _read(self) -> None:
        """Reads the next packet."""
        import av

        try:
            packet = next(self._packets)
        except (StopIteration, av.FFmpegError, OSError, ValueError):
            self._settle(None)
            return
        if packet.size == 0 and packet.pts is None:  # the packet that flushes a decoder
            return
        if packet.pts is None:
            self._pending.clear()  # the order relative to these is unknown
            self._settle(None)
            return
        if packet.is_keyframe and not packet.is_discard:
            insort(self._keys, packet.pts)
        if not packet.is_discard:
            insort(self._pending, packet.pts)
        if packet.dts is not None:
            self._settle(packet.dts)

    def _settle(self, before: int | None) -> None:
        """Makes stamps below `before` final; None for all, at the end of the clip."""
        self._ended = self._ended or before is None
        n = len(self._pending) if before is None else bisect_right(self._pending, before - 1)
        for stamp in self._pending[:n]:
            self._stamps.append(stamp)
            self._edges.append(self._placed(len(self._edges)))
        del self._pending[:n]

    def _placed(self, n: int) -> int:
        """Time of frame n, ps."""
        even = self._clock.edge(n)
        if n == 0:
            return even
        seconds = (self._stamps[n] - self._stamps[0]) * self._tick
        at = int(seconds * PS)
        if abs(seconds - n / self._rate) < self._tick and even > self._edges[-1]:
            return even
        self.uneven = True
        return at if at > self._edges[-1] else self._edges[-1] + self._clock.edge(1)

    def stamp(self, n: int) -> int | None:
        """The stamp of frame n, ticks of the stream; None beyond the end."""
        while len(self._stamps) <= n and not self._ended:
            self._read()
        return self._stamps[n] if n < len(self._stamps) else None

    def edge(self, n: int) -> int:
        """Time of frame n, ps; extrapolated at the mean rate beyond the end."""
        if self.stamp(n) is not None:
            return self._edges[n]
        last = len(self._edges) - 1
        return self._edges[last] + self._clock.edge(n - last)

    def number_at(self, ps: int) -> int:
        """Number of the frame at the time `ps`; extrapolated beyond the end."""
        while not self._ended and (not self._edges or self._edges[-1] <= ps):
            self._read()
        n = max(bisect_right(self._edges, ps) - 1, 0)
        if n == len(self._edges) - 1 and self._edges:
            n += self._clock.cycle_at(max(ps - self._edges[-1], 0))
        return n

    def number_of(self, stamp: int) -> int | None:
        """Number of the frame with this final stamp; None if no frame or several have it."""
        n = bisect_left(self._stamps, stamp)
        return n if self._stamps[n : n + 2].count(stamp) == 1 else None

    def key_before(self, n: int) -> int | None:
        """The stamp of the last key frame up to frame n; None without one."""
        stamp = self.stamp(n)
        at = len(self._keys) if stamp is None else bisect_right(self._keys, stamp)
        return self._keys[at - 1] if at else None
