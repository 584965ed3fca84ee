"""Decodes video clips and images, of any format that PyAV supports, to frames of linear light.

A frame is decoded to RGB, de-interlaced if it has two fields, linearised by its transfer curve,
reduced to luminance (Rec. ITU-R BT.709), turned upright, scaled to cover the sensor, and cropped at
the centre. Under a filter array it keeps its colours until each pixel takes that of its filter.
Pictures of floats (Radiance HDR, OpenEXR, PFM, TIFF) are linear light already, with white at 1 and
no upper limit.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any, Final

from cosim import InputError, Plane
from cosim.light.mosaic import Mosaic
from scenarios.scenes.clips.coded import Coded, float_values, is_of_floats
from scenarios.scenes.clips.filtered import Pose, deinterlaced, pose_of
from scenarios.scenes.clips.fitted import DECODING, MOST_PIXELS, Fit
from scenarios.scenes.clips.timeline import Timeline

__all__ = ["Clip"]

_FAR: Final = 8
"""Number of frames ahead from which on a seek to a key frame saves time."""
_PROBED: Final = 1000
"""Packets that are read to tell a clip from a still beside it."""
_KEPT: Final = 3
"""Decoded frames that are kept: one of two fields is shown with those before and after it."""
_OF_OTHERS: Final = (2, 3)
"""FFmpeg's numbers of frames that are told by others, P and B."""
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


class Clip:
    """Frames of a clip or image on a (height, width) grid, by number, in any order.

    `frame(n)` is (H, W) float32, white = 1: in [0, 1], or from 0 on for pictures of floats; behind
    a mosaic that is not `mixed`, (H, W, 3) in linear red, green and blue. For a frame far ahead, or
    behind, decoding starts at the last key frame before it, or, without a timeline, at the start of
    the file. The frames in between are decoded but not converted.

    Attributes:
        notes: notes for the user.
        size: (height, width) of a picture, its pixels.
        rate: frame rate, 1/s; 0 for a still image.
        count: number of frames decoded so far.
        ended: whether the clip has no more frames.
        timeline: times of the frames; None if the file has none.
    """

    def __init__(
        self, path: Path, shape: tuple[int, int], mosaic: Mosaic | None = None, mixed: bool = True
    ) -> None:
        self._path = path
        self.notes: list[str] = []
        self._fit = Fit(path, shape, mosaic, mixed, self.notes)
        self._coded = Coded(path.name, mosaic is not None, self._fit)
        self._strict = True  # damaged pictures are refused first, so that they can be noted
        self._iterator: Iterator[Any] | None = None
        self._next = 0
        self._decoded: dict[int, Any] = {}  # the latest frames by their numbers
        self._planes: dict[int, Plane] = {}
        self._poses: dict[int, Pose] = {}
        self.ended = False
        self.rate = Fraction(0)
        self.count = 0
        self.timeline: Timeline | None = None
        self._first_stamps: list[int | None] = []
        self._start()
        if self.frame(0) is None:
            raise self._fit.bad("no picture in it")
        if self.frame(1) is None:
            self.rate = Fraction(0)
        elif (timeline := Timeline.opened(path, self.rate, self._stream.index)) is not None:
            stamps = [timeline.stamp(0), timeline.stamp(1)]
            if None not in stamps and stamps == self._first_stamps:
                self.timeline = timeline

    def _undecodable(self, exc: Exception) -> InputError:
        """The refusal of a file in which decoding failed."""
        if 0 in getattr(self, "size", (1,)) and not isinstance(exc, MemoryError):
            # FFmpeg does not say why it has refused the size
            return self._fit.bad(f"damaged, or of more than {MOST_PIXELS:,} pixels")
        return self._fit.undecodable(exc)

    def _start(self) -> None:
        import av

        try:
            if not self._path.is_file():
                raise self._fit.bad("not a file" if self._path.exists() else "no such file")
            container = av.open(str(self._path), options=DECODING)
            if not container.streams.video or container.format.name == "tty":  # a text file
                container.close()
                raise self._fit.bad("no picture in it")
            found = _shown(container, self._path)
            if found is None:
                container.close()
                raise self._fit.bad("no picture in it other than a cover")
            stream, streams = found
            if streams > 1:
                number = list(container.streams.video).index(stream) + 1
                self._fit.note(
                    f"{self._path.name}: the picture of stream {number} is filmed, of "
                    f"{len(container.streams.video)} with pictures"
                )
            stream.thread_type = "AUTO"
            if stream.codec_context is None:
                raise self._fit.bad("pictures in a form without a decoder")
            strict = self._strict and _is_still(container.format.name)
            self._means = DECODING | ({"err_detect": "explode"} if strict else {})
            stream.codec_context.options = self._means
            self._fit.check_size(stream.codec_context.height, stream.codec_context.width)
            self._aspect = float(stream.sample_aspect_ratio or 1)
            self.size = stream.codec_context.height, stream.codec_context.width
            self.rate = stream.average_rate or stream.guessed_rate or Fraction(25)
        except (av.FFmpegError, OSError, ValueError) as exc:
            raise self._undecodable(exc) from None
        self._container, self._stream = container, stream
        self._decoded.clear()
        self._iterator, self._next, self.ended = self._decoding(), 0, False

    def _decoding(self) -> Iterator[Any]:
        """The frames from the place of the container on."""
        import av

        name = _WITH_ALPHA.get(self._stream.codec_context.name)
        if name is None or self._stream.metadata.get("alpha_mode") != "1":
            return iter(self._container.decode(self._stream))
        try:
            decoder: Any = av.CodecContext.create(name, "r")
        except ValueError:  # FFmpeg without it
            self._fit.note(f"{self._path.name}: its transparency is left out")
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
            self.ended = True
            return False
        except (av.FFmpegError, OSError, ValueError) as exc:
            if self._next == 0 and self._strict and _is_still(self._container.format.name):
                self._strict = False
                self._start()
                if self._decode():
                    self._fit.note(
                        f"{self._path.name} is damaged: only a part of it can be decoded"
                    )
                    return True
            if self._next == 0:
                raise self._undecodable(exc) from None
            self._fit.note(f"{self._path.name} cannot be decoded beyond frame {self._next - 1}")
            self.ended = True
            return False
        if self.timeline is None:
            self._check_time(frame)
            self._first_stamps = [*self._first_stamps, frame.pts][:2]
        self._keep(frame)
        return True

    def _keep(self, frame: Any) -> None:
        """Keeps the next frame, with those before it."""
        self._decoded[self._next] = frame
        self._decoded.pop(self._next - _KEPT, None)
        self._next += 1
        self.count = max(self.count, self._next)

    def _check_time(self, frame: Any) -> None:
        """Notes a frame whose time differs from a uniform rate. The first two frames are decoded
        before the timeline is read."""
        if frame.time is None or not self.rate:
            return
        if self._next == 0:
            self._zero = frame.time
        elif (
            self._next > 1 and abs((frame.time - self._zero) * float(self.rate) - self._next) > 0.5
        ):
            self._fit.note(
                f"{self._path.name}: frames are not evenly spaced; a uniform rate is used"
            )

    def _plane(self, n: int) -> Plane:
        """Frame n, one of those decoded, as linear light; a few planes are cached."""
        if n not in self._planes:
            self._planes = {k: p for k, p in self._planes.items() if n - 2 <= k < n}
            self._planes[n] = self._linear(n)
        return self._planes[n]

    def _linear(self, n: int) -> Plane:
        frame = self._decoded[n]
        self._fit.check_size(frame.height, frame.width)
        pose = self._pose(frame)
        if is_of_floats(frame):
            return self._fit.floats(float_values(frame), self._aspect, pose)
        if frame.interlaced_frame:
            frame = deinterlaced(self._decoded.get(n - 1), frame, self._decoded.get(n + 1))
            self._fit.note(
                f"{self._path.name} is interlaced: the first field of each frame is filmed, the "
                "lines between are interpolated (BWDIF)"
            )
        if n == 0 and not frame.key_frame and frame.pict_type in _OF_OTHERS:
            self._fit.note(f"{self._path.name} does not begin with a key frame: its first are torn")
        light = self._coded.light(frame)
        return self._fit.on(light, self._aspect, pose, most=self._coded.most)

    def _pose(self, frame: Any) -> Pose:
        """How a frame is turned upright: as the first one of the same rotation."""
        if frame.rotation not in self._poses:
            self._poses[frame.rotation] = pose_of(frame)
        return self._poses[frame.rotation]

    def frame(self, n: int) -> Plane | None:
        """Frame n, (H, W) float32; None if the clip ends before it."""
        if n in self._planes:
            return self._planes[n]
        if not self._reach(n):
            return None
        if self._decoded[n].interlaced_frame:
            if n and n - 1 not in self._decoded:
                self._begin_before(n - 1)
                self._reach(n - 1)
            self._reach(n + 1)
            if not self._reach(n):
                return None
        return self._plane(n)

    def _reach(self, n: int) -> bool:
        """Decodes up to frame n; False if the clip ends before it."""
        if n not in self._decoded and not self._next <= n <= self._next + _FAR:
            self._begin_before(n)
        while self._next <= n:
            if self.ended or not self._decode():
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

    def last(self) -> Plane:
        """The frame decoded last; the last one of the clip if it has ended."""
        return self._plane(self._next - 1)
