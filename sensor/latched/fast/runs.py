"""Segments of a course in the form that a launch of a kernel takes.

A launch reads at most MOST_PLANES planes, so a course may need several. Its segments are a table of
integers, which light.cl describes, and one list of weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.latched.fast.course import MOST_PLANES, Course, Segment

_ENTRY: Final = 7 + MOST_PLANES
"""Integers that describe a segment to a kernel."""


@dataclass(frozen=True, eq=False)
class Run:
    """Segments of one launch.

    Attributes:
        entries: (segments, _ENTRY) int32.
        weights: (n,) float32, weights and anchors of all segments.
        rows: rows of weights: those of the box, or 1.
        planes: identities of the planes, in the order in which the entries number them.
    """

    entries: npt.NDArray[np.int32]
    weights: npt.NDArray[np.float32]
    rows: int
    planes: tuple[int, ...]


def runs_of(course: Course) -> Iterator[Run]:
    """The segments of a course, in launches that use at most MOST_PLANES planes each."""
    some: list[Segment] = []
    met: dict[int, int] = {}
    for segment in course.segments:
        new = {id(plane) for plane in (segment.base, *segment.planes)} - met.keys()
        if some and len(met) + len(new) > MOST_PLANES:
            yield _run(some, met, course.longest)
            some, met = [], {}
        for plane in (segment.base, *segment.planes):
            met.setdefault(id(plane), len(met))
        some.append(segment)
    if some:
        yield _run(some, met, course.longest)


def _run(segments: list[Segment], slots: dict[int, int], longest: float) -> Run:
    """One launch. slots: number of each plane; longest: see `Course`."""
    longer = np.float32(longest).view(np.int32) if longest > 1 else 0
    entries = np.zeros((len(segments), _ENTRY), np.int32)
    begin = 1  # weight 0 is for segments without planes
    places = []
    for entry, segment in zip(entries, segments, strict=True):
        used = [slots[id(segment.base)], len(segment.planes)]
        used += [slots[id(plane)] for plane in segment.planes]
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
    return Run(entries, weights, rows, tuple(slots))
