"""Decodes the frames of a file by number, in any order, with what FFmpeg knows of it."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any, Final

from cosim import InputError
from scenarios.scenes.clips.file_cache import CachedFile, Opened
from scenarios.scenes.clips.fitted import DECODING, MOST_PIXELS, Fit
from scenarios.scenes.clips.timeline import Timeline

_FAR: Final = 8
"""Number of frames ahead from which on a seek to a key frame saves time."""
_PROBED: Final = 1000
"""Packets that are read to tell a clip from a still beside it."""
_NEAR: Final = 3
"""Decoded frames that a decoder keeps: one of two fields is shown with those around it."""
_WITH_ALPHA: Final = {"vp8": "libvpx", "vp9": "libvpx-vp9"}
"""Decoders of the transparency of WebM, which FFmpeg's own leave out, by the name of the codec."""


def _is_still(name: str) -> bool:
    """Whether a container of FFmpeg, by its name, holds a single picture. Not TIFF, of which FFmpeg
    takes any tag that it does not know for damage."""
    return (name.endswith("_pipe") or name == "image2") and name != "tiff_pipe"


def _shown(container: Any, path: Path) -> tuple[Any, int] | None:
    """The stream of a clip, and the number of those it could be; None if all are covers."""
    from av.stream import Disposition

    aside = Disposition.attached_pic | Disposition.timed_thumbnails
    streams = [each for each in container.streams.video if not each.disposition & aside]
    best = container.streams.best("video")
    if len(streams) > 1:
        likely = [each for each in streams if each.frames != 1]
        if any(not each.frames for each in likely):  # not told
            moving = _moving(path, [each.index for each in likely], best.index)
            likely = [each for each in likely if each.index in moving]
        streams = likely or streams
    return (best if best in streams else streams[0], len(streams)) if streams else None


def _moving(path: Path, streams: list[int], best: int) -> set[int]:
    """Which of these streams have several frames, by the first packets of the file."""
    import av

    found: set[int] = set()
    seen: set[int] = set()
    with av.open(str(path), options=DECODING) as container:
        packets = container.demux([container.streams[n] for n in streams])
        for packet in islice(packets, _PROBED):
            if packet.size:  # without, it flushes a decoder
                (found if packet.stream.index in seen else seen).add(packet.stream.index)
            if best in found:
                break
    return found


class Decoder:
    """Decodes frames of a file by number, in any order.

    For a frame far ahead, or behind, decoding starts at the last key frame before it, or, without a
    timeline, at the start of the file. What is known of the file, such as its end, is shared with
    its other decoders; a file that was opened before is opened again for frames that are not kept.

    Args:
        path: the file.
        kept: what is kept of it.
        fit: refuses what cannot be decoded.

    Attributes:
        opened: size, rate and stream of the file.
        timeline: times of the frames; None if the file has none.
        count: number of frames decoded so far.
        ended: whether the clip has no more frames.
        last: number of the frame given last; of the last one if the clip has ended.
    """

    def __init__(self, path: Path, kept: CachedFile, fit: Fit) -> None:
        self._path, self._kept, self._fit = path, kept, fit
        self._container: Any = None
        self._iterator: Iterator[Any] | None = None
        self._next, self._over = 0, False  # where the iterator is
        self._decoded: dict[int, Any] = {}  # the latest frames by their numbers
        self.ended = False
        self.count = self.last = 0
        self.timeline: Timeline | None = None
        if kept.opened is None:
            self._open()
        opened = self.opened
        self._strict = opened.strict
        if opened.rate:
            found = Timeline.opened(path, opened.rate, opened.index)
            if found is not None:
                stamps = found.stamp(0), found.stamp(1)
                if None not in stamps and stamps == opened.stamps:
                    self.timeline = found

    @property
    def opened(self) -> Opened:
        assert self._kept.opened is not None
        return self._kept.opened

    def _open(self) -> None:
        """Decodes the first two frames, and keeps what is known by them."""
        self._strict, self._rate = True, Fraction(0)  # damaged pictures are refused first
        self._stamps: list[int | None] = []
        self._start()
        if not self._decode():
            raise self._fit.bad("no picture in it")
        rate = self._rate if self._decode() else Fraction(0)
        first, second = [*self._stamps, None, None][:2]
        self._kept.opened = Opened(
            self._size, self._aspect, rate, self._stream.index, self._strict, (first, second)
        )

    def _note(self, text: str, at: int = 0) -> None:
        """What the user is told of frame `at`."""
        if all(text != said for _, said in self._kept.notes):
            self._kept.notes.append((at, text))

    def _undecodable(self, exc: Exception) -> InputError:
        """The refusal of a file in which decoding failed."""
        if 0 in getattr(self, "_size", (1,)) and not isinstance(exc, MemoryError):
            # FFmpeg does not say why it has refused the size
            return self._fit.bad(f"damaged, or of more than {MOST_PIXELS:,} pixels")
        return self._fit.undecodable(exc)

    def _start(self) -> None:
        import av

        try:
            if not self._path.is_file():
                raise self._fit.bad("not a file" if self._path.exists() else "no such file")
            if self._kept.changed:  # some of its frames are those of another file
                raise self._fit.bad("a file that has changed since its first frames were read")
            container = av.open(str(self._path), options=DECODING)
            if not container.streams.video or container.format.name == "tty":  # a text file
                container.close()
                raise self._fit.bad("no picture in it")
            stream = self._chosen(container)
            stream.thread_type = "AUTO"
            if stream.codec_context is None:
                raise self._fit.bad("pictures in a form without a decoder")
            strict = self._strict and _is_still(container.format.name)
            self._means = DECODING | ({"err_detect": "explode"} if strict else {})
            stream.codec_context.options = self._means
            self._fit.check_size(stream.codec_context.height, stream.codec_context.width)
            self._aspect = float(stream.sample_aspect_ratio or 1)
            self._size = stream.codec_context.height, stream.codec_context.width
            self._rate = stream.average_rate or stream.guessed_rate or Fraction(25)
        except (av.FFmpegError, OSError, ValueError) as exc:
            raise self._undecodable(exc) from None
        self._container, self._stream = container, stream
        self._decoded.clear()
        self._iterator, self._next = self._decoding(), 0
        self.ended = self._over = False

    def _chosen(self, container: Any) -> Any:
        """The stream of the container that is filmed."""
        if self._kept.opened is not None:
            return container.streams[self._kept.opened.index]
        found = _shown(container, self._path)
        if found is None:
            container.close()
            raise self._fit.bad("no picture in it other than a cover")
        stream, streams = found
        if streams > 1:
            number = list(container.streams.video).index(stream) + 1
            self._note(
                f"{self._path.name}: the picture of stream {number} is filmed, of "
                f"{len(container.streams.video)} with pictures"
            )
        return stream

    def _decoding(self) -> Iterator[Any]:
        """The frames from the place of the container on."""
        import av

        name = _WITH_ALPHA.get(self._stream.codec_context.name)
        if name is None or self._stream.metadata.get("alpha_mode") != "1":
            return iter(self._container.decode(self._stream))
        try:
            decoder: Any = av.CodecContext.create(name, "r")
        except ValueError:  # FFmpeg without it
            self._note(f"{self._path.name}: its transparency is left out")
            return iter(self._container.decode(self._stream))
        decoder.options = self._means
        return (
            frame
            for packet in self._container.demux(self._stream)
            for frame in decoder.decode(packet if packet.size else None)
        )

    def _decode(self) -> bool:
        """Decodes the next frame; False after the last."""
        import av

        assert self._iterator is not None
        try:
            frame = next(self._iterator)
        except (StopIteration, av.EOFError):
            self.ended = self._over = True
            self._kept.count = self._next
            return False
        except (av.FFmpegError, OSError, ValueError) as exc:
            if self._next == 0 and self._strict and _is_still(self._container.format.name):
                self._strict = False
                self._start()
                if self._decode():
                    self._note(f"{self._path.name} is damaged: only a part of it can be decoded")
                    return True
            if self._next == 0:
                raise self._undecodable(exc) from None
            told = f"{self._path.name} cannot be decoded beyond frame {self._next - 1}"
            self._note(told, self._next)
            self.ended = self._over = True
            return False
        if self.timeline is None:
            self._check_time(frame)
            if self._kept.opened is None:
                self._stamps.append(frame.pts)
        self._keep(frame)
        return True

    def _keep(self, frame: Any) -> None:
        """Keeps the next frame, with those before it."""
        self._decoded[self._next] = frame
        self._decoded.pop(self._next - _NEAR, None)
        self._next += 1
        self.count = max(self.count, self._next)

    def _check_time(self, frame: Any) -> None:
        """Notes a frame whose time differs from a uniform rate. The first two frames are decoded
        before the timeline is read."""
        if frame.time is None or not self._rate:
            return
        if self._next == 0:
            self._zero = frame.time
        elif (
            self._next > 1 and abs((frame.time - self._zero) * float(self._rate) - self._next) > 0.5
        ):
            told = f"{self._path.name}: frames are not evenly spaced; a uniform rate is used"
            self._note(told, self._next)

    def frame(self, n: int) -> Any | None:
        """Frame n as it was decoded; None if the clip ends before it."""
        found = self._decoded.get(n)
        if found is None:
            found = self._kept.frame(n)
        if found is None and not self.ends_before(n) and self._reach(n):
            found = self._decoded[n]
        if found is not None:
            self.given(n)
        elif not self.ends_before(n):  # it cannot be decoded to its end
            self.last = self._next - 1
        return found

    def ends_before(self, n: int) -> bool:
        """Whether it is known already that the clip ends before frame n."""
        count = self._kept.count
        if count is None or n < count:
            return False
        self.ended, self.count, self.last = True, count, count - 1
        return True

    def given(self, n: int) -> None:
        """Notes that frame n was given, also if it was not decoded anew."""
        self.count, self.last = max(self.count, n + 1), n

    def _reach(self, n: int) -> bool:
        """Decodes up to frame n; False if the clip ends before it."""
        if self._iterator is None:
            self._start()
        if n not in self._decoded and not self._next <= n <= self._next + _FAR:
            self._begin_before(n)
        while self._next <= n:
            if self._over or not self._decode():
                return False
        return n in self._decoded

    def _begin_before(self, n: int) -> None:
        """Sets the position of the decoder to a frame close before n."""
        key = None if self.timeline is None else self.timeline.key_before(n)
        if key is not None and self._seek(key, n):
            return
        if n < self._next:
            self._start()

    def _seek(self, key: int, n: int) -> bool:
        """Seeks to the key frame with the stamp `key` and returns True. Returns False if decoding
        on is as fast. If the file does not support the seek, decoding restarts at its beginning."""
        import av

        assert self.timeline is not None
        begins = self.timeline.number_of(key)
        if begins is None or (self._next <= n and begins <= self._next):
            return False
        self._start()
        try:
            self._container.seek(key, stream=self._stream, backward=True)
            self._iterator = self._decoding()
            for frame in self._iterator:
                number = None if frame.pts is None else self.timeline.number_of(frame.pts)
                if number is None or number > begins:
                    break
                if number == begins:
                    self._next = begins
                    self._keep(frame)
                    return True
        except (av.FFmpegError, OSError, ValueError):
            pass
        self._start()
        return True
