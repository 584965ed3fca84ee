"""Slow motion for a video: consecutive exposures of a camera, reduced in size and in 8 bits."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Clock
from cosim.report.png import for_display
from display.observe.integration import LightPlanes, reduced
from display.observe.observers import CameraPlane

Values = npt.NDArray[np.floating[Any]]

FRAMES: Final = 160
"""Maximum number of exposures of a run."""
TILE: Final = 400
"""Maximum length of the longer side of a picture, pixels."""


class SlowMotion:
    """Consecutive exposures, reduced to means over `by` x `by` pixels.

    A display with a renderer uses the observer `camera(first, stop)` for the exposures that its
    planes overlap (`touched`), and passes each complete exposure to `Film.keep`.

    Args:
        shape: (height, width) of the display, pixels.
        begin, end: limits of the exposures, ps.
        exposure: length of an exposure, ps.
        by: side of the squares that are averaged, pixels.

    Attributes:
        shape: (height, width) of the reduced pictures, pixels.
        count: number of exposures.

    Raises:
        ValueError: `exposure` or `by` is out of range.
    """

    def __init__(
        self, shape: tuple[int, int], begin: int, end: int, exposure: int, by: int = 2
    ) -> None:
        if not 1 <= exposure <= end - begin:
            raise ValueError(f"exposure must be 1 to {end - begin} ps, not {exposure} ps")
        if not 1 <= by <= min(shape):
            raise ValueError(f"by must be 1 to {min(shape)}, not {by}")
        self.begin, self.exposure, self.by = begin, exposure, by
        self.shape = shape[0] // by, shape[1] // by
        self.count = (end - begin) // exposure

    def camera(self, first: int, stop: int) -> CameraPlane:
        """The observer of the exposures `first` to `stop`."""
        return CameraPlane(
            tuple(self.begin + n * self.exposure + self.exposure // 2 for n in range(first, stop)),
            self.exposure,
        )

    def touched(self, start: int, stop: int) -> tuple[int, int]:
        """The first exposure that overlaps `start` to `stop`, ps, and the one after the last."""
        first = min(max((start - self.begin) // self.exposure, 0), self.count)
        last = -(-(stop - self.begin) // self.exposure)
        return first, min(max(last, first), self.count)


def exposure_cycles(cycles: int) -> int:
    """Number of cycles in an exposure, for a run of `cycles`."""
    return -(-cycles // FRAMES)


def slow_motion(clock: Clock, cycles: int, shape: tuple[int, int]) -> SlowMotion:
    """The slow motion of a run. Cycles that do not fill an exposure are left out at the start,
    where a panel is dark.

    Args:
        clock: clock of the stream.
        cycles: length of the run, cycles.
        shape: (height, width) of the display, pixels.
    """
    every = exposure_cycles(cycles)
    first = cycles % every
    exposure = (clock.edge(cycles) - clock.edge(first)) // (cycles // every)
    by = min(-(-max(shape) // TILE), *shape)  # a narrow strip stays longer
    return SlowMotion(shape, clock.edge(first), clock.edge(cycles), exposure, by)


class Film:
    """The exposures of a display.

    Attributes:
        motion: times and size of the exposures.
        frames: (count, h, w) uint8, with the sRGB curve applied.
        done: number of complete exposures.
    """

    def __init__(self, motion: SlowMotion) -> None:
        self.motion = motion
        self.frames = np.zeros((motion.count, *motion.shape), np.uint8)
        self.done = 0
        self._open: dict[int, npt.NDArray[np.float32]] = {}

    def keep(self, index: int, plane: Values) -> None:
        """Stores a complete exposure of a renderer, (H, W), white = 1."""
        picture = reduced(plane[None], np.ones((1, 1), np.float32), self.motion.by)
        self.frames[index] = for_display(picture[0])

    def add(self, light: LightPlanes) -> None:
        """Adds light of a display to the exposures that it falls on."""
        if not light.spans:
            return
        motion = self.motion
        first, stop = motion.touched(
            min(s.start for s in light.spans), max(s.stop for s in light.spans)
        )
        if first == stop:
            return
        images = light.reduced(motion.camera(first, stop), motion.by)
        for index, image in enumerate(images, first):
            self._open[index] = self._open[index] + image if index in self._open else image

    def close(self, until: int) -> None:
        """Completes the exposures that end by `until`, ps. All light before it must have been
        added."""
        motion = self.motion
        stop = min(max((until - motion.begin) // motion.exposure, self.done), motion.count)
        for index in range(self.done, stop):
            image = self._open.pop(index, None)
            if image is not None:
                self.frames[index] = for_display(image)
        self.done = stop

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next step depends on."""
        opened = sorted(self._open)
        images = [self._open[n] for n in opened]
        return {
            "frames": self.frames[: self.done].copy(), "open": np.array(opened, np.int64),
            "images": np.stack(images) if images else np.zeros((0, *self.motion.shape), np.float32),
        }  # fmt: skip

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self.done = len(state["frames"])
        self.frames[:] = 0
        self.frames[: self.done] = state["frames"]
        self._open = {
            int(n): np.array(image, np.float32)
            for n, image in zip(state["open"], state["images"], strict=True)
        }
