"""Survey of a scene before anything is simulated: the range of the light at every pixel.

For a scene with few pieces of light, all pieces are read, and the range is exact. A scene that is
rendered every few cycles is sampled at SAMPLES instants. The light that moving edges bring between
them is taken from the neighbourhood that an edge can cross in that time; this range is an estimate
and is marked as such.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from math import ceil
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.light.light import Light, Piece, Plane
from cosim.light.source import Sketch, Source
from cosim.stage import BLOCK, Block

SAMPLES = 9
"""Instants at which a rendered scene is sampled."""


@runtime_checkable
class Sketched(Protocol):
    """A source that provides samples, because rendering all of it would take long."""

    def sketch(self, cycles: int, samples: int) -> Sketch: ...


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames in memory between which light is linear, from the first frame of a run on.

    Attributes:
        frames: (T, H, W), all that the run shows: uint8 codes, or float32 light.
        table: lux of a code, (256,) float32; for light (2,) float32, factors of which the first is
            multiplied first.
        edges: (T,) instants of the frames, ps.
        pieces: number of pieces of light in the run.
    """

    frames: npt.NDArray[np.uint8] | npt.NDArray[np.float32]
    table: npt.NDArray[np.float32]
    edges: tuple[int, ...]
    pieces: int


@runtime_checkable
class Framed(Protocol):
    """A source that may have its frames in memory, of which the survey is made in one pass."""

    def frames(self, cycles: int) -> Frames | None: ...


@dataclass(frozen=True, eq=False)
class Survey:
    """Range of the light of a run at every pixel.

    Attributes:
        least, most: limits over all instants, (H, W) lux.
        certain: (H, W) bool, whether these limits are proven.
        planes: new planes of light per cycle.
        slope: limit of the change of the light within a cycle, (H, W) lux; None if not known.
        moved: sum of all changes of the light, (H, W) lux; None if not known.
    """

    least: Plane
    most: Plane
    certain: npt.NDArray[np.bool_]
    planes: float
    slope: Plane | None = None
    moved: Plane | None = None

    @property
    def steady(self) -> npt.NDArray[np.bool_]:
        """(H, W) bool, whether the light is constant."""
        return np.asarray((self.least == self.most) & self.certain)


class _Range:
    """The range of the light of pieces that follow each other.

    Args:
        cycle: length of a cycle, ps.
    """

    def __init__(self, cycle: int) -> None:
        self._cycle, self.count = cycle, 0
        self._pieces: list[Piece] = []
        self._last: Plane | None = None
        self._planes: tuple[Plane, Plane, Plane, Plane] | None = None

    def take(self, piece: Piece) -> None:
        """Extends the range by a piece, unless it is one of the last few."""
        from cosim.light.survey_compiled import widen  # numba, which not every start need load

        if any(piece is known for known in self._pieces):
            return
        self._pieces, self.count = [*self._pieces[-8:], piece], self.count + 1
        first, last = (np.ascontiguousarray(end, np.float32) for end in (piece.first, piece.last))
        if self._planes is None:
            none = np.zeros(first.shape, np.float32)
            self._planes = first.copy(), first.copy(), none, none.copy()
        elif self._last is not None and piece.first is not self._last:
            widen(first, np.ascontiguousarray(self._last), np.float32(np.inf), *self._planes)
        if not piece.constant:
            widen(last, first, _share(self._cycle, piece.stop - piece.start), *self._planes)
        self._last = piece.last

    def survey(self, cycles: int) -> Survey:
        """The survey of the pieces of a run."""
        assert self._planes is not None  # a run has light
        return _survey(*self._planes, self.count, cycles)


def _share(cycle: int, whole: int) -> np.float32:
    """Part of the change of a piece of `whole` ps that a cycle may have. Of shorter pieces a cycle
    has several, whose changes may add up."""
    return np.float32(cycle / whole if whole >= cycle else np.inf)


def _survey(
    least: Plane, most: Plane, slope: Plane, moved: Plane, pieces: int, cycles: int
) -> Survey:
    """The survey of a number of pieces with these ranges."""
    np.minimum(slope, most - least, out=slope)
    return Survey(least, most, np.ones(least.shape, bool), (pieces - 1) / cycles, slope, moved)


def _survey_of_frames(given: Frames, clock: Clock, cycles: int) -> Survey:
    """The exact survey of frames in memory."""
    from cosim.light.survey_compiled import widen_by_frames

    cycle = ceil(PS * clock.period)
    shares = [_share(cycle, b - a) for a, b in pairwise(given.edges)]
    planes = [np.empty(given.frames.shape[1:], np.float32) for _ in range(4)]
    frames = np.ascontiguousarray(given.frames)
    widen_by_frames(frames, given.table, np.array(shares, np.float32), *planes)
    least, most, slope, moved = planes
    return _survey(least, most, slope, moved, given.pieces, cycles)


def _exact_survey(source: Source, clock: Clock, cycles: int) -> Survey:
    """The exact survey, from every piece of the run."""
    seen, start = _Range(ceil(PS * clock.period)), 0
    while start < cycles:
        light = source.step(None, Block(start, min(BLOCK, cycles - start)))
        for piece in light.pieces:
            seen.take(piece)
        # Light that extends beyond the block is not requested again.
        start = max(start + BLOCK, min(clock.cycle_at(light.pieces[-1].stop - 1), cycles))
    return seen.survey(cycles)


def survey(source: Source, clock: Clock, cycles: int) -> Survey:
    """The survey of a run of `cycles` cycles. It consumes the source."""
    given = source.frames(cycles) if isinstance(source, Framed) else None
    if given is not None:
        return _survey_of_frames(given, clock, cycles)
    if not isinstance(source, Sketched):
        return _exact_survey(source, clock, cycles)
    sketch = source.sketch(cycles, SAMPLES)
    least, most = limits(sketch)
    certain = np.ones(least.shape, bool)
    y0, y1, x0, x1 = sketch.box
    certain[y0:y1, x0:x1] = False
    return Survey(least, most, certain, sketch.planes_per_cycle)


def limits(sketch: Sketch) -> tuple[Plane, Plane]:
    """Least and most light of a sketched scene, (H, W) each, in lux: over its samples, and in its
    box over what an edge may bring from around a pixel between them."""
    from scipy.ndimage import maximum_filter, minimum_filter

    least, most = reduce(np.minimum, sketch.planes).copy(), reduce(np.maximum, sketch.planes).copy()
    y0, y1, x0, x1 = sketch.box
    if y1 > y0 and x1 > x0:
        reach = int(min(np.ceil(sketch.reach), max(least.shape)))
        wide = (
            slice(max(y0 - reach, 0), y1 + reach),
            slice(max(x0 - reach, 0), x1 + reach),
        )
        inner = (slice(y0 - wide[0].start, y1 - wide[0].start),
                 slice(x0 - wide[1].start, x1 - wide[1].start))  # fmt: skip
        size = 2 * reach + 1
        least[y0:y1, x0:x1] = minimum_filter(least[wide], size, mode="nearest")[inner]
        most[y0:y1, x0:x1] = maximum_filter(most[wide], size, mode="nearest")[inner]
    return least, most


def through(light: Survey, relay: Callable[[Light], Light]) -> Survey:
    """The survey of light after a linear relay, which must preserve the order of levels."""

    def mapped(plane: Plane) -> Plane:
        piece = Piece(0, 1, plane, plane)
        return relay(Light((piece,))).pieces[0].first

    certain = light.certain
    if not certain.all():
        certain = ~(mapped((~certain).astype(np.float32)) > 0)
    slope, moved = (None if each is None else mapped(each) for each in (light.slope, light.moved))
    return Survey(mapped(light.least), mapped(light.most), certain, light.planes, slope, moved)
