"""Segments of a course in the form that a launch of a kernel takes.

A launch reads at most MOST_PLANES planes, so a course may need several. Its segments are a table of
integers, which light.cl describes, and one list of weights. Both depend on the instants of the
light alone: calls that film frames of one rate share them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.light.light import Box, Light, Plane
from sensor.latched.fast.course import MOST_PLANES, Course, Segment

_ENTRY: Final = 7 + MOST_PLANES
"""Integers that describe a segment to a kernel."""
_KEPT: Final = 8
"""Launches of earlier light that are kept."""
_LARGE: Final = 4 << 20
"""Bytes of tables and weights that are not kept."""


@dataclass(frozen=True, eq=False)
class Run:
    """Segments of one launch.

    Attributes:
        entries: (segments, _ENTRY) int32.
        weights: (n,) float32, weights and anchors of all segments.
        rows: rows of weights: those of the box, or 1.
        planes: (H, W) float32 each, in the order in which the entries number them.
    """

    entries: npt.NDArray[np.int32]
    weights: npt.NDArray[np.float32]
    rows: int
    planes: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class Launches:
    """What kernels need of a course.

    Attributes:
        steady: (H, W) float32, light outside the box.
        box: rows and columns in which the light changes, None if it is constant everywhere.
        runs: segments inside the box.
    """

    steady: Any
    box: Box | None
    runs: tuple[Run, ...]

    def on(self, change: Callable[[Any], Any]) -> Launches:
        """The same with other planes: `change` of each."""
        runs = (replace(run, planes=tuple(map(change, run.planes))) for run in self.runs)
        return Launches(change(self.steady), self.box, tuple(runs))


def launches_of(course: Course) -> Launches:
    """What kernels need of a course."""
    return Launches(course.steady, course.box, tuple(_runs_of(course)))


class LaunchCache:
    """Launches for light, without its planes; the last few are kept.

    Args:
        course: the course of light over cycles, from their first and their number.
    """

    def __init__(self, course: Callable[[Light, int, int], Course]) -> None:
        self._course = course
        self._known: dict[tuple[Any, ...], Launches] = {}

    def __call__(self, light: Light, start: int, cycles: int) -> Launches:
        """The launches for light over these cycles."""
        slots: dict[int, int] = {}
        planes: list[Plane] = []
        pattern = []
        for piece in light.pieces:
            for plane in (piece.first, piece.last):
                if id(plane) not in slots:
                    slots[id(plane)] = len(planes)
                    planes.append(plane)
            ends = slots[id(piece.first)], slots[id(piece.last)]
            pattern.append((piece.start, piece.stop, piece.changed, *ends))
        key = start, cycles, tuple(pattern)
        known = self._known.get(key)
        if known is not None:
            return known.on(planes.__getitem__)
        made = launches_of(self._course(light, start, cycles))
        size = sum(run.entries.nbytes + run.weights.nbytes for run in made.runs)
        # The planes of some cycles are computed from those of the light.
        own = all(id(plane) in slots for run in made.runs for plane in run.planes)
        if own and size <= _LARGE:
            slotted = made.on(lambda plane: slots[id(plane)])
            self._known = dict([*self._known.items()][1 - _KEPT :]) | {key: slotted}
        return made


def _runs_of(course: Course) -> Iterator[Run]:
    """The segments of a course, in launches that use at most MOST_PLANES planes each."""
    some: list[Segment] = []
    met: dict[int, tuple[int, Plane]] = {}
    for segment in course.segments:
        new = {id(plane) for plane in (segment.base, *segment.planes)} - met.keys()
        if some and len(met) + len(new) > MOST_PLANES:
            yield _run(some, met, course.longest)
            some, met = [], {}
        for plane in (segment.base, *segment.planes):
            met.setdefault(id(plane), (len(met), plane))
        some.append(segment)
    if some:
        yield _run(some, met, course.longest)


def _run(segments: list[Segment], slots: dict[int, tuple[int, Plane]], longest: float) -> Run:
    """One launch. slots: number of each plane, and the plane; longest: see `Course`."""
    longer = np.float32(longest).view(np.int32) if longest > 1 else 0
    entries = np.zeros((len(segments), _ENTRY), np.int32)
    begin = 1  # weight 0 is for segments without planes
    places = []
    for entry, segment in zip(entries, segments, strict=True):
        used = [slots[id(segment.base)][0], len(segment.planes)]
        used += [slots[id(plane)][0] for plane in segment.planes]
        at = begin if segment.weights.size else 0
        entry[: 3 + len(used)] = segment.first, segment.cycles, at, *used
        places.append((begin, segment.weights))
        begin += segment.weights.size
        if segment.anchors is None:
            entry[-1] = longer
            continue
        entry[-2], entry[-1] = begin, np.float32(segment.slope).view(np.int32)
        places.append((begin, segment.anchors))
        begin += segment.anchors.size
    weights = np.zeros(begin, np.float32)
    for at, values in places:
        weights[at : at + values.size].reshape(values.shape)[...] = values
    rows = max(segment.weights.shape[1] for segment in segments)
    return Run(entries, weights, rows, tuple(plane for _, plane in slots.values()))
