"""Slow motion: exposures of a camera back to back, small and in 8 bits, for a video."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from display import CameraPlane, Lit, Onlooker
from scenarios.png import for_display

__all__ = ["Film", "SlowMotion"]

Values = npt.NDArray[np.floating[Any]]


class SlowMotion:
    """Which exposures there are: back to back from `begin` to `end` (ps), of `exposure` ps each,
    reduced to 1 / `by` of their rows and columns by the mean over areas.

    A display whose renderer makes images of any `Observer` gives it `camera(first, stop)`, the
    exposures that its planes touch (`touched`), and keeps each whole one with `Film.keep`.
    """

    def __init__(
        self, shape: tuple[int, int], begin: int, end: int, exposure: int, by: int = 2
    ) -> None:
        if exposure < 1 or end - begin < exposure or by < 1:
            raise ValueError(
                f"an exposure must be 1 ps to {end - begin} ps and reduced by 1 or more, not "
                f"{exposure} ps and {by}"
            )
        self.full, self.begin, self.exposure, self.by = shape, begin, exposure, by
        self.shape = max(shape[0] // by, 1), max(shape[1] // by, 1)
        self.count = (end - begin) // exposure

    def camera(self, first: int, stop: int) -> CameraPlane:
        """The observer that makes exposures `first` to `stop`."""
        return CameraPlane(
            tuple(self.begin + n * self.exposure + self.exposure // 2 for n in range(first, stop)),
            self.exposure,
        )

    def touched(self, start: int, stop: int) -> tuple[int, int]:
        """The first exposure that has light of `start` to `stop` (ps), and the first after it."""
        first = min(max((start - self.begin) // self.exposure, 0), self.count)
        last = -(-(stop - self.begin) // self.exposure)
        return first, min(max(last, first), self.count)

    def reduced(self, plane: Values) -> npt.NDArray[np.float32]:
        """A plane of `full` size as a small one."""
        import cv2

        if self.by == 1:
            return plane.astype(np.float32)
        size = self.shape[::-1]
        small = cv2.resize(plane.astype(np.float32, copy=False), size, interpolation=cv2.INTER_AREA)
        return np.asarray(small, np.float32)


class Film:
    """The exposures of one display: `frames` (count, h, w) uint8 through the sRGB curve, of which
    the first `done` are whole."""

    def __init__(self, motion: SlowMotion) -> None:
        self.motion = motion
        self.frames = np.zeros((motion.count, *motion.shape), np.uint8)
        self.done = 0
        self._open: dict[int, npt.NDArray[np.float32]] = {}

    def keep(self, index: int, plane: Values) -> None:
        """Exposure `index` as a display's renderer has made it whole, (H, W), white = 1."""
        self.frames[index] = for_display(self.motion.reduced(plane))

    def add(self, lit: Lit) -> None:
        """Light of a display that is told as planes over time."""
        if not lit.spans:
            return
        motion = self.motion
        first, stop = motion.touched(
            min(s.start for s in lit.spans), max(s.stop for s in lit.spans)
        )
        if first == stop:
            return
        camera = motion.camera(first, stop)
        if len(lit.planes) <= stop - first:  # whichever are fewer are made small
            small = Lit(np.stack([motion.reduced(plane) for plane in lit.planes]), lit.spans)
            looker = Onlooker(camera, motion.shape)
            looker.add(small)
            images = looker.images
        else:
            looker = Onlooker(camera, motion.full)
            looker.add(lit)
            images = np.stack([motion.reduced(image) for image in looker.images])
        for index, image in enumerate(images, first):
            self._open[index] = self._open[index] + image if index in self._open else image

    def close(self, until: int) -> None:
        """All light before `until` (ps) has come: exposures that end by then are whole."""
        motion = self.motion
        stop = min(max((until - motion.begin) // motion.exposure, self.done), motion.count)
        for index in range(self.done, stop):
            image = self._open.pop(index, None)
            if image is not None:
                self.frames[index] = for_display(image)
        self.done = stop

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next step depends on."""
        opened = sorted(self._open)
        images = [self._open[n] for n in opened]
        return {
            "frames": self.frames[: self.done].copy(), "open": np.array(opened, np.int64),
            "images": np.stack(images) if images else np.zeros((0, *self.motion.shape), np.float32),
        }  # fmt: skip

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self.done = len(state["frames"])
        self.frames[:] = 0
        self.frames[: self.done] = state["frames"]
        self._open = {
            int(n): np.array(image, np.float32)
            for n, image in zip(state["open"], state["images"], strict=True)
        }
