"""The run-in of an imager: it records the first instant of the scene until its controls settle. The
scene then starts such that the middle of an exposure is at the compared instant."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS
from cosim.frames import Frame
from imagers.common.scenery import Scenery

STILL = 8
"""Number of consecutive frames with one exposure after which the controls count as settled."""
MOST = 40
"""Number of frames after which the scene starts although the controls have not settled."""
_FOREVER = 1000 * PS
_MOMENT = PS // 1_000_000
"""Interval over which the light of the first instant is averaged, ps."""
Values = npt.NDArray[np.float64]
Instants = npt.NDArray[np.int64]


@dataclass(eq=False)
class RunIn:
    """Scenery that holds its first instant until it is started.

    Attributes:
        scenery: the scene from its time 0 on.
        offset: time of the imager at the scene's time 0, ps; None before the start.
    """

    scenery: Scenery
    offset: int | None = None
    _first: Values = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows = self.scenery.shape[0]
        begin = np.zeros(rows, np.int64)
        self._first = self.scenery.lux_seconds(0, begin, begin + _MOMENT) / (_MOMENT / PS)

    @property
    def shape(self) -> tuple[int, int]:
        return self.scenery.shape

    def lux_seconds(self, first: int, begin: Instants, end: Instants) -> Values:
        """Implements `Scenery.lux_seconds`."""
        offset = _FOREVER if self.offset is None else self.offset
        begin, end = begin - offset, end - offset
        still = (np.minimum(end, 0) - np.minimum(begin, 0)) / PS
        total = self._first[first : first + begin.size] * still[:, None]
        if (end > 0).any():
            moving = self.scenery.lux_seconds(first, np.maximum(begin, 0), np.maximum(end, 0))
            total = total + moving
        return np.asarray(total)


@dataclass(frozen=True, eq=False)
class Placed:
    """Scenery on a part of a larger plane; the rest is dark.

    Attributes:
        scenery: scenery of the part.
        size: (rows, columns) of the plane.
        corner: (row, column) of the part's first pixel.
    """

    scenery: Any
    size: tuple[int, int]
    corner: tuple[int, int]

    @property
    def shape(self) -> tuple[int, int]:
        return self.size

    def lux_seconds(self, first: int, begin: Instants, end: Instants) -> Values:
        """Implements `Scenery.lux_seconds`."""
        total = np.zeros((begin.size, self.size[1]))
        (height, width), (row, column) = self.scenery.shape, self.corner
        low, high = max(first, row), min(first + begin.size, row + height)
        if low < high:
            part = slice(low - first, high - first)
            light = self.scenery.lux_seconds(low - row, begin[part], end[part])
            total[part, column : column + width] = light
        return total


@dataclass(frozen=True, eq=False)
class Footage:
    """The recorded frames of an imager.

    Attributes:
        still: frames of the first instant with equal exposures, in order.
        frame: the frame at the compared instant.
        offset: time of the imager at the scene's time 0, ps.
        period: time between frames, ps.
        settled: whether the controls settled before the start of the scene.
    """

    still: list[Frame]
    frame: Frame
    offset: int
    period: int
    settled: bool


def middle(frame: Frame) -> int:
    """Middle of the exposure of the middle row, ps."""
    row = len(frame.begin) // 2
    return int(frame.begin[row] + frame.end[row]) // 2


def _tail(frames: list[Frame]) -> list[Frame]:
    """The last frames that have the same exposure, at most STILL."""
    last, tail = frames[-1].exposure, list[Frame]()
    for frame in reversed(frames):
        if frame.exposure != last:
            break
        tail.append(frame)
    return tail[:STILL][::-1]


def film_at(
    imager: Any, placed: Any, light: RunIn, instant: int, seed: int, effects: frozenset[str]
) -> Footage:
    """Records up to the frame whose middle is nearest to the compared instant.

    Args:
        imager: imager of the catalogue.
        placed: light on the pixels of the imager: `light`, or a `Placed` of it.
        light: the scene, which this function starts.
        instant: compared instant in the time of the scene, ps.
        seed: seed of the temporal noise.
        effects: names of the simulated effects.
    """
    film: Iterator[Frame] = imager.film(placed, _FOREVER // 2, seed=seed, kept=effects)
    pictures = (frame for frame in film if not frame.state.get("key"))
    frames: list[Frame] = []
    for frame in pictures:
        frames.append(frame)
        if len(_tail(frames)) == STILL or len(frames) == MOST:
            break
    still, settled = _tail(frames), len(_tail(frames)) == STILL
    period = middle(frames[-1]) - middle(frames[-2])
    now = middle(frames[-1])
    ahead = math.ceil((frames[-1].ready - now + instant) / period) + 1
    light.offset = now + ahead * period - instant
    best = None
    for frame in pictures:
        distance = abs(middle(frame) - light.offset - instant)
        if best is not None and distance > abs(middle(best) - light.offset - instant):
            break
        best = frame
    assert best is not None
    return Footage(still, best, light.offset, period, settled)
