"""The light on an imager's plane, integrated over each row's own exposure.

A rolling shutter gives every row its own beginning and end, so light is requested by rows. A still
picture under light that changes (`Still`) is integrated in closed form; any other scene through its
`Light` (`LightScenery`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.light.light import Light

Values = npt.NDArray[np.float64]
Instants = npt.NDArray[np.int64]


class Scenery(Protocol):
    """Illuminance on an imager's plane.

    Attributes:
        shape: (H, W) of the plane.
    """

    @property
    def shape(self) -> tuple[int, int]: ...

    def lux_seconds(self, first: int, begin: Instants, end: Instants) -> Values:
        """Exposure of rows `first`, `first` + 1, ...: (rows, W) float64, lx s on the plane.

        begin, end: (rows,) int64 ps, begin <= end, end < 2^62.
        """
        ...


@dataclass(frozen=True)
class Course:
    """A factor of the light over time: linear between knots, constant before the first and after
    the last. Two knots at one instant are a jump.

    Attributes:
        knots: (ps, factor), in order, factors >= 0.
    """

    knots: tuple[tuple[int, float], ...] = ((0, 1.0),)

    def __post_init__(self) -> None:
        if not self.knots:
            raise ValueError("a course must have at least one knot")
        times = [t for t, _ in self.knots]
        if times != sorted(times):
            raise ValueError("a course's knots must be in order of time")
        if any(not 0 <= f < np.inf for _, f in self.knots):
            raise ValueError("a course's factors must be finite and not negative")

    def at(self, ps: int) -> float:
        """The factor at an instant; at a jump, the later one."""
        times = [t for t, _ in self.knots]
        after = int(np.searchsorted(times, ps, side="right"))
        if after == 0 or after == len(times):
            return self.knots[min(after, len(times)) - 1 if after else 0][1]
        (t0, f0), (t1, f1) = self.knots[after - 1], self.knots[after]
        return f0 + (f1 - f0) * ((ps - t0) / (t1 - t0))

    def integral(self, begin: Instants, end: Instants) -> Values:
        """Integral of the factor from begin to end, s, piece by piece: the difference of two long
        integrals would lose the precision of a short exposure late in a run."""
        begin, end = np.asarray(begin, np.int64), np.asarray(end, np.int64)
        total = np.zeros(np.broadcast(begin, end).shape)
        far = 2**62
        knots = [(-far, self.knots[0][1]), *self.knots, (far, self.knots[-1][1])]
        for (t0, f0), (t1, f1) in pairwise(knots):
            a, b = np.maximum(begin, t0), np.minimum(end, t1)
            inside = b > a
            if t1 <= t0 or not inside.any():
                continue
            middle = ((a - t0) + (b - t0)) / 2 / float(t1 - t0) if f0 != f1 else 0.0
            total += np.where(inside, (f0 + (f1 - f0) * middle) * ((b - a) / PS), 0.0)
        return total


@dataclass(frozen=True, eq=False)
class Still:
    """A picture that does not move, under light that changes.

    Attributes:
        lux: (H, W) on the plane, for a factor of 1.
        course: the factor over time.
    """

    lux: Values
    course: Course = Course()

    @property
    def shape(self) -> tuple[int, int]:
        return self.lux.shape[0], self.lux.shape[1]

    def lux_seconds(self, first: int, begin: Instants, end: Instants) -> Values:
        """See `Scenery`."""
        rows = self.lux[first : first + begin.size]
        return rows * self.course.integral(begin, end)[:, None]


@dataclass(frozen=True, eq=False)
class LightScenery:
    """A scene given as `Light` on the plane.

    Attributes:
        size: (H, W) of the plane.
        light: returns the light of a span of time, from begin to end, ps.
    """

    size: tuple[int, int]
    light: Callable[[int, int], Light]

    @property
    def shape(self) -> tuple[int, int]:
        return self.size

    def lux_seconds(self, first: int, begin: Instants, end: Instants) -> Values:
        """See `Scenery`."""
        given = self.light(int(begin.min()), int(end.max()))
        total = np.zeros((begin.size, self.size[1]))
        rows = slice(first, first + begin.size)
        for piece in given.pieces:
            a, b = np.maximum(begin, piece.start), np.minimum(end, piece.stop)
            span = np.maximum(b - a, 0) / PS
            if not span.any():
                continue
            low = piece.first[rows].astype(np.float64)
            if piece.constant:
                total += low * span[:, None]
                continue
            part = ((a - piece.start) + (b - piece.start)) / (2.0 * (piece.stop - piece.start))
            total += (low + (piece.last[rows] - low) * part[:, None]) * span[:, None]
        return total
