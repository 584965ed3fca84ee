"""Decodes video clips and images, of any format that PyAV supports, to frames of linear light.

A frame is decoded to RGB, rotated upright, linearised by its transfer curve, reduced to luminance
(Rec. ITU-R BT.709), scaled to cover the sensor, and cropped at the centre. Under a filter array it
keeps its colours until each pixel takes that of its filter. Pictures of floats (Radiance HDR,
OpenEXR, PFM, TIFF) are linear light already, with white at 1 and no upper limit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import InputError, Plane
from cosim.light.mosaic import Mosaic
from scenarios.scenes.clips.fitted import DECODING, LUMINANCE, MOST_PIXELS, Fit
from scenarios.scenes.clips.timeline import Timeline

__all__ = ["SRGB", "Clip", "transfer_curve"]

# Transfer characteristics: code point (ITU-T H.273, table 3) -> exponent of the display. Clips are
# made for displays, so BT.709 and unspecified characteristics use the sRGB curve.
_POWER = {4: 2.2, 5: 2.8, 8: 1.0}
_AS_SRGB = {0, 1, 2, 3, 6, 7, 13, 14, 15}

SRGB = 13
"""Transfer characteristic "sRGB" (ITU-T H.273, table 3)."""
_FLOATS = re.compile(r"f(16|32)(le|be)?$")
"""The end of FFmpeg's names of pixel formats with floats."""
_FAR = 8
"""Number of frames ahead from which on a seek to a key frame saves time."""
_BAND = 1 << 14
"""Pixels of a picture that are converted at once."""
# Code values of white. FFmpeg's 16-bit RGB is exact for RGB and grey, but for YUV it has white at
# 255 x 256 + 3; its 8-bit RGB of 8-bit pictures is accurate to one code.
_WHITE_8, _WHITE_16, _WHITE_16_FROM_YUV = 255, 65535, 65283


@lru_cache
def transfer_curve(code: int, white: int) -> npt.NDArray[np.float32]:
    """Linear light of each code value, white = 1; the array is shared."""
    v = np.minimum(np.arange(256 if white == _WHITE_8 else 65536) / white, 1)
    if code in _POWER:
        return (v ** _POWER[code]).astype(np.float32)
    # IEC 61966-2-1, sRGB to linear
    linear = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


def _luminance(
    picture: npt.NDArray[np.uint8], curve: npt.NDArray[np.float32]
) -> npt.NDArray[np.float32]:
    """Linear luminance of an 8-bit picture, transparent parts black: (H, W) float32.

    OpenCV takes a fifth of numpy's time for it, and in bands that fit in the cache again a half.

    Args:
        picture: (H, W, 3 or 4) uint8, red, green, blue, and alpha.
        curve: (256,) float32, linear light of each code value.
    """
    import cv2

    height, width, channels = picture.shape
    curves = np.stack([curve, curve, curve, np.arange(256, dtype=np.float32) / 255], axis=1)
    weights = np.append(LUMINANCE, np.float32(0))[None, :channels]
    luminance = np.empty((height, width), np.float32)
    step = max(_BAND // width, 1)
    for top in range(0, height, step):
        lit = cv2.LUT(picture[top : top + step], curves[None, :, :channels])
        band = luminance[top : top + step]
        band[...] = cv2.transform(lit, weights)
        if channels == 4:
            band *= lit[..., 3]
    return luminance


def _values(frame: Any) -> npt.NDArray[Any]:
    """The floats of a frame, (H, W) or (H, W, 3). FFmpeg's own conversion would clip them."""
    name = frame.format.name
    if not name.startswith(("gbrpf16", "gbrapf16", "grayf16")):
        values: npt.NDArray[Any] = frame.to_ndarray()
        return values[..., :3] if values.ndim == 3 else values
    kind = np.dtype(np.float16).newbyteorder(">" if name.endswith("be") else "<")
    planes = [
        np.frombuffer(plane, kind).reshape(plane.height, -1)[:, : plane.width]
        for plane in frame.planes
    ]  # green, blue, red
    return planes[0] if len(planes) < 3 else np.stack([planes[2], planes[0], planes[1]], axis=2)


def _is_still(name: str) -> bool:
    """Whether a container of FFmpeg, by its name, holds a single picture."""
    return name.endswith("_pipe") or name == "image2"


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
        self._path, self._mosaic = path, mosaic
        self.notes: list[str] = []
        self._fit = Fit(path, shape, mosaic, mixed, self.notes)
        self._strict = True  # damaged pictures are refused first, so that they can be noted
        self._iterator: Iterator[Any] | None = None
        self._next = 0
        self._latest: tuple[int, Any] | None = None
        self._planes: dict[int, Plane] = {}
        self._curves: dict[tuple[int, int], npt.NDArray[np.float32]] = {}
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
        elif (timeline := Timeline.opened(path, self.rate)) is not None:
            stamps = [timeline.stamp(0), timeline.stamp(1)]
            if None not in stamps and stamps == self._first_stamps:
                self.timeline = timeline

    def _undecodable(self, exc: Exception) -> InputError:
        """The refusal of a file in which decoding failed. FFmpeg reports sizes beyond its limits,
        which a damaged file states, as a lack of memory."""
        if isinstance(exc, MemoryError):
            return self._fit.bad("damaged: it states more data than a clip can have")
        if 0 in getattr(self, "size", (1,)):  # FFmpeg does not say why it has refused the size
            return self._fit.bad(f"damaged, or of more than {MOST_PIXELS:,} pixels")
        return self._fit.bad(str(getattr(exc, "strerror", None) or exc))

    def _start(self) -> None:
        import av

        try:
            if not self._path.is_file():
                raise self._fit.bad("not a file" if self._path.exists() else "no such file")
            container = av.open(str(self._path), options=DECODING)
            if not container.streams.video or container.format.name == "tty":  # a text file
                container.close()
                raise self._fit.bad("no picture in it")
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            if stream.codec_context is None:
                raise self._fit.bad("pictures in a form without a decoder")
            strict = self._strict and _is_still(container.format.name)
            stream.codec_context.options = DECODING | ({"err_detect": "explode"} if strict else {})
            self._fit.check_size(stream.codec_context.height, stream.codec_context.width)
            self._aspect = float(stream.sample_aspect_ratio or 1)
            self.size = stream.codec_context.height, stream.codec_context.width
            self.rate = stream.average_rate or stream.guessed_rate or Fraction(25)
        except (av.FFmpegError, OSError, ValueError) as exc:
            raise self._undecodable(exc) from None
        self._iterator, self._next, self.ended = container.decode(stream), 0, False
        self._container, self._stream = container, stream

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
        self._latest = (self._next, frame)
        self._next += 1
        self.count = max(self.count, self._next)
        return True

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

    def _plane(self) -> Plane:
        """The latest frame as linear light; a few planes are cached."""
        assert self._latest is not None
        number, frame = self._latest
        if number not in self._planes:
            self._planes = {n: p for n, p in self._planes.items() if number - 2 <= n < number}
            self._planes[number] = self._linear(frame)
        return self._planes[number]

    def _linear(self, frame: Any) -> Plane:
        self._fit.check_size(frame.height, frame.width)
        turns = round(float(getattr(frame, "rotation", 0) or 0) / 90) % 4
        if _FLOATS.search(frame.format.name):
            return self._fit.floats(_values(frame), self._aspect, turns)
        return self._fit.on(self._decoded(frame), self._aspect, turns, most=1)

    def _decoded(self, frame: Any) -> npt.NDArray[np.float32]:
        """Linear light of a picture of code values."""
        code = int(frame.color_trc or 2)
        if code not in _POWER and code not in _AS_SRGB:
            self._fit.note(f"transfer characteristics {code} (H.273) are treated as sRGB")
        parts = frame.format.components
        deep = max(part.bits for part in parts) > 8
        grey_or_rgb = len(parts) < 3 or frame.format.is_rgb
        white = (_WHITE_16 if grey_or_rgb else _WHITE_16_FROM_YUV) if deep else _WHITE_8
        if (code, white) not in self._curves:
            self._curves[code, white] = transfer_curve(code, white)
        curve, clear = self._curves[code, white], any(part.is_alpha for part in parts)
        luminance: npt.NDArray[np.float32]
        if deep or self._mosaic is not None:
            luminance = curve[frame.to_ndarray(format="rgb48le" if deep else "rgb24")]
            if self._mosaic is None:
                luminance = luminance @ LUMINANCE
            if clear:
                alpha = frame.to_ndarray(format="rgba")[..., 3] / np.float32(255)
                luminance *= alpha if self._mosaic is None else alpha[..., None]
        else:
            luminance = _luminance(frame.to_ndarray(format="rgba" if clear else "rgb24"), curve)
        if clear:
            self._fit.note(f"{self._path.name}: transparent parts are black")
        return luminance

    def frame(self, n: int) -> Plane | None:
        """Frame n, (H, W) float32; None if the clip ends before it."""
        if n in self._planes:
            return self._planes[n]
        if n < self._next - 1 or n > self._next + _FAR:
            self._begin_before(n)
        while self._next <= n:
            if self.ended or not self._decode():
                return None
        return self._plane()

    def _begin_before(self, n: int) -> None:
        """Sets the position of the decoder to a frame close before n."""
        key = None if self.timeline is None else self.timeline.key_before(n)
        if key is not None and self._seek(key, n):
            return
        if n < self._next - 1:
            self._start()

    def _seek(self, key: int, n: int) -> bool:
        """Seeks to the key frame with the stamp `key` and returns True. Returns False if decoding
        on is as fast. If the file does not support the seek, decoding restarts at its beginning."""
        import av

        assert self.timeline is not None
        begins = self.timeline.number_of(key)
        if begins is None or (self._next - 1 <= n and begins <= self._next):
            return False
        self._start()
        try:
            self._container.seek(key, stream=self._stream, backward=True)
            self._iterator = self._container.decode(self._stream)
            for frame in self._iterator:
                number = None if frame.pts is None else self.timeline.number_of(frame.pts)
                if number is None or number > begins:
                    break
                if number == begins:
                    self._latest, self._next = (begins, frame), begins + 1
                    self.count = max(self.count, self._next)
                    return True
        except (av.FFmpegError, OSError, ValueError):
            pass
        self._start()
        return True

    def last(self) -> Plane:
        """The frame decoded last; the last one of the clip if it has ended."""
        return self._plane()
