"""Slow motion: short exposures one after another, each held in a slot of the renderer while light
falls on it and taken as soon as it is over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cosim import Clock
from display import CameraPlane, SpikePanel
from scenarios.png import for_display

__all__ = ["FRAMES", "Slots", "SlowMotion", "slow_motion", "small"]

FRAMES = 160
"""At most, in a run's slow motion."""
TILE = 480
"""Pixels of the longer side of one display's picture in it, at most."""
Grey = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class SlowMotion:
    """Exposures one after another. exposures: their middles and length (ps). tile: (height, width)
    of a picture, the panel's reduced."""

    exposures: CameraPlane
    tile: tuple[int, int]

    @property
    def frames(self) -> int:
        return self.exposures.images

    def first(self, frame: int) -> int:
        """Instant (ps) at which a frame's exposure begins."""
        return self.exposures.instants[frame] - self.exposures.exposure // 2

    def last(self, frame: int) -> int:
        """Instant (ps) at which a frame's exposure is over."""
        return self.first(frame) + self.exposures.exposure

    def over(self, start: int, stop: int) -> list[int]:
        """Frames on which light of [start, stop) (ps) falls."""
        return [f for f in range(self.frames) if self.first(f) < stop and self.last(f) > start]

    def one(self, frames: Sequence[int]) -> CameraPlane:
        """The observer that makes these frames."""
        instants = tuple(self.exposures.instants[f] for f in frames)
        return CameraPlane(instants, self.exposures.exposure)


def slow_motion(clock: Clock, cycles: int, shape: tuple[int, int], batch: int) -> SlowMotion:
    """A run of `cycles` in at most FRAMES exposures of whole spans, without gaps. Time that is left
    over at the start is not shown: a panel is dark then in any case."""
    spans = max(cycles // batch, 1)
    every = -(-spans // FRAMES) * batch if cycles >= batch else cycles
    frames = max(cycles // every, 1)
    begin = cycles - frames * every
    edges = [clock.edge(begin + f * every) for f in range(frames + 1)]
    middles = tuple((a + b) // 2 for a, b in pairwise(edges))
    reduce = max(1, -(-max(shape) // TILE))
    tile = max(1, shape[0] // reduce), max(1, shape[1] // reduce)
    return SlowMotion(CameraPlane(middles, edges[1] - edges[0]), tile)


def small(image: npt.NDArray[Any], tile: tuple[int, int]) -> Grey:
    """A picture for the slow motion: linear light reduced to a tile (means over areas), through the
    sRGB curve, (tile) uint8."""
    light = np.clip(image, 0, 1).astype(np.float32)
    if light.shape != tile:
        light = cv2.resize(light, (tile[1], tile[0]), interpolation=cv2.INTER_AREA)
    return for_display(light)


class Slots:
    """Which frame is in which slot, draw by draw. There are as many slots as frames on which light
    falls at once."""

    def __init__(self, slow: SlowMotion, panel: SpikePanel, cycles: int, draw: int) -> None:
        self._slow, self._panel, self._cycles = slow, panel, cycles
        self._late = round(panel.row_delay)
        busy = (len(self._during(n, min(draw, cycles - n))) for n in range(0, cycles, draw))
        self.count = max(busy, default=0)
        self.held = np.full(self.count, -1, np.int64)
        """Frame in each slot, -1 for none."""

    def _during(self, first: int, planes: int) -> list[int]:
        start, stop = self._panel.start(first), self._panel.start(first + planes) + self._late
        return self._slow.over(start, stop)

    def begin(self, first: int, planes: int) -> list[tuple[int, int]]:
        """(slot, frame) of the frames that gather light of these planes."""
        for frame in self._during(first, planes):
            if frame not in self.held:
                self.held[int(np.flatnonzero(self.held < 0)[0])] = frame
        return [(s, int(f)) for s, f in enumerate(self.held) if f >= 0]

    def finished(self, stop: int) -> list[tuple[int, int]]:
        """(slot, frame) that no light of plane `stop` or a later one falls on; they are free."""
        until = None if stop >= self._cycles else self._panel.start(stop)
        done = [
            (s, int(f)) for s, f in enumerate(self.held)
            if f >= 0 and (until is None or self._slow.last(int(f)) <= until)
        ]  # fmt: skip
        for slot, _ in done:
            self.held[slot] = -1
        return done
