"""Decodes video clips and images, of any format that PyAV supports, to frames of linear light.

A frame is decoded to RGB, de-interlaced if it has two fields, linearised by its transfer curve,
reduced to luminance (Rec. ITU-R BT.709), turned upright, scaled to cover the sensor, and cropped at
the centre. Under a filter array it keeps its colours until each pixel takes that of its filter.
Pictures of floats (Radiance HDR, OpenEXR, PFM, TIFF) are linear light already, with white at 1 and
no upper limit.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cosim import Plane
from cosim.light.mosaic import Mosaic
from scenarios.scenes.clips.decoder import Decoder
from scenarios.scenes.clips.file_cache import Fitted, cached_file
from scenarios.scenes.clips.fitted import Fit, Pose, deinterlaced, pose_of
from scenarios.scenes.clips.frame_converter import FrameConverter, float_values, is_of_floats
from scenarios.scenes.clips.timeline import Timeline

_OF_OTHERS = (2, 3)
"""FFmpeg's numbers of frames that are told by others, P and B."""


class Clip:
    """Frames of a clip or image on a (height, width) grid, by number, in any order.

    `frame(n)` is (H, W) float32, white = 1: in [0, 1], or from 0 on for pictures of floats; behind
    a mosaic that is not `mixed`, (H, W, 3) in linear red, green and blue. Frames that are needed
    again come from the cache of the process, see `kept`; others are decoded, see `Decoder`.

    Attributes:
        notes: notes for the user.
        size: (height, width) of a picture, its pixels.
        rate: frame rate, 1/s; 0 for a still image.
        timeline: times of the frames; None if the file has none.
    """

    def __init__(
        self, path: Path, shape: tuple[int, int], mosaic: Mosaic | None = None, mixed: bool = True
    ) -> None:
        self._path = path
        self.notes: list[str] = []
        self._fit = Fit(path, shape, mosaic, mixed, self.notes)
        self._coded = FrameConverter(path.name, mosaic is not None, self._fit)
        filters = None if mosaic is None else (mosaic.name, mosaic.response.tobytes(), mixed)
        self._kept, self._grid = cached_file(path), (shape, filters)
        self._planes: dict[int, Plane] = {}
        self._poses: dict[int, Pose] = {}
        with self._kept.lock:
            self._decoder = Decoder(path, self._kept, self._fit)
        self.size, self.rate = self._decoder.opened.size, self._decoder.opened.rate
        self.frame(0)
        self.frame(1)

    @property
    def timeline(self) -> Timeline | None:
        return self._decoder.timeline

    @property
    def count(self) -> int:
        """Number of frames that were needed so far, or of all if the clip has ended."""
        return self._decoder.count

    @property
    def ended(self) -> bool:
        """Whether the clip has no more frames."""
        return self._decoder.ended

    def frame(self, n: int) -> Plane | None:
        """Frame n, (H, W) float32; None if the clip ends before it."""
        with self._kept.lock:
            fitted = self._fitted(n)
            if fitted is None:
                return None
            self._decoder.given(n)
            return fitted

    def _fitted(self, n: int) -> Plane | None:
        """`frame`, from those at hand, the cache, or the file."""
        if n in self._planes:
            return self._planes[n]
        fitted = self._kept.fitted(self._grid, n)
        if fitted is None:
            frame = self._decoder.frame(n)
            self._tell(n)
            if frame is None:
                return None
            fitted = self._converted(n, frame)
            self._kept.keep(self._grid, n, fitted, frame)
        else:
            self._tell(n)
            self._coded.most = max(self._coded.most, fitted.most)
            for text in fitted.notes:
                self._fit.note(text)
        self._planes = {k: p for k, p in self._planes.items() if n - 2 <= k < n}
        self._planes[n] = fitted.plane
        return fitted.plane

    def _tell(self, n: int) -> None:
        """Notes what is known of decoding up to frame n."""
        for at, text in self._kept.notes:
            if at <= n:
                self._fit.note(text)

    def _converted(self, n: int, frame: Any) -> Fitted:
        self._fit.told.clear()
        plane = self._linear(n, frame)
        return Fitted(plane, tuple(self._fit.told), self._coded.most)

    def _linear(self, n: int, frame: Any) -> Plane:
        """Frame n as linear light."""
        if frame.interlaced_frame:
            before = self._decoder.frame(n - 1) if n else None
            frame = self._decoder.frame(n)  # the one before it may be far
            after = self._decoder.frame(n + 1)
            self._tell(n + 1)
        self._fit.check_size(frame.height, frame.width)
        pose = self._pose(frame)
        aspect = self._decoder.opened.aspect
        if is_of_floats(frame):
            return self._fit.floats(float_values(frame), aspect, pose)
        if frame.interlaced_frame:
            frame = deinterlaced(before, frame, after)
            self._fit.note(
                f"{self._path.name} is interlaced: the first field of each frame is filmed, the "
                "lines between are interpolated (BWDIF)"
            )
        if n == 0 and not frame.key_frame and frame.pict_type in _OF_OTHERS:
            self._fit.note(f"{self._path.name} does not begin with a key frame: its first are torn")
        light = self._coded.light(frame)
        return self._fit.on(light, aspect, pose, most=self._coded.most)

    def _pose(self, frame: Any) -> Pose:
        """How a frame is turned upright: as the first one of the same rotation."""
        if frame.rotation not in self._poses:
            self._poses[frame.rotation] = pose_of(frame)
        return self._poses[frame.rotation]

    def last(self) -> Plane:
        """The frame given last; the last one of the clip if it has ended."""
        plane = self.frame(self._decoder.last)
        assert plane is not None
        return plane
