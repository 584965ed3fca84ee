"""A run-in: an imager films the scene's first instant until its controls rest. Then the scene
begins, so that the middle of one exposure falls on the instant that is compared."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS
from cosim.frames import Frame
from sensor.imagers import Scenery

__all__ = ["Footage", "Placed", "RunIn", "film_at", "middle"]

STILL = 8
"""Frames of one exposure, in a row, after which the controls are taken to rest."""
MOST = 40
"""Frames after which the scene begins although they do not."""
_FOREVER = 1000 * PS
_MOMENT = PS // 1_000_000
"""Over which the light of the first instant is taken, ps."""
Values = npt.NDArray[np.float64]
Instants = npt.NDArray[np.int64]


@dataclass(eq=False)
class RunIn:
    """Scenery that stands still until it is started.

    Attributes:
        scenery: the scene from its time 0 on.
        offset: time of the imager when the scene's time is 0, ps; None while the scene stands.
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
        """See `Scenery`."""
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
    """Scenery on a part of a larger plane that is dark elsewhere.

    Attributes:
        scenery: on the part.
        size: rows and columns of the plane.
        corner: row and column of the part's first pixel.
    """

    scenery: Any
    size: tuple[int, int]
    corner: tuple[int, int]

    @property
    def shape(self) -> tuple[int, int]:
        return self.size

    def lux_seconds(self, first: int, begin: Instants, end: Instants) -> Values:
        """See `Scenery`."""
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
    """What an imager has filmed.

    Attributes:
        still: frames of the first instant with equal exposures, in order.
        frame: the frame at the instant that is compared.
        offset: see `RunIn`.
        period: from frame to frame, ps.
        rested: whether the controls came to rest.
    """

    still: list[Frame]
    frame: Frame
    offset: int
    period: int
    rested: bool


def middle(frame: Frame) -> int:
    """Middle of the middle row's exposure, ps."""
    row = len(frame.begin) // 2
    return int(frame.begin[row] + frame.end[row]) // 2


def _tail(frames: list[Frame]) -> list[Frame]:
    """The last frames of one exposure."""
    last, tail = frames[-1].exposure, list[Frame]()
    for frame in reversed(frames):
        if frame.exposure != last:
            break
        tail.append(frame)
    return tail[:STILL][::-1]


def film_at(
    imager: Any, placed: Any, light: RunIn, instant: int, seed: int, kept: frozenset[str]
) -> Footage:
    """Films until the frame whose middle is nearest to the scene's `instant`, ps.

    placed: the light as it falls on the imager's plane; `light` itself or around it.
    """
    film: Iterator[Frame] = imager.film(placed, _FOREVER // 2, seed=seed, kept=kept)
    shown = (frame for frame in film if not frame.state.get("key"))
    frames: list[Frame] = []
    for frame in shown:
        frames.append(frame)
        if len(_tail(frames)) == STILL or len(frames) == MOST:
            break
    still, rested = _tail(frames), len(_tail(frames)) == STILL
    period = middle(frames[-1]) - middle(frames[-2])
    now = middle(frames[-1])
    ahead = math.ceil((frames[-1].ready - now + instant) / period) + 1
    light.offset = now + ahead * period - instant
    best = None
    for frame in shown:
        away = abs(middle(frame) - light.offset - instant)
        if best is not None and away > abs(middle(best) - light.offset - instant):
            break
        best = frame
    assert best is not None
    return Footage(still, best, light.offset, period, rested)
