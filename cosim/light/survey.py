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
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Light, Piece, Plane
from cosim.light.source import Sketch, Source
from cosim.stage import BLOCK, Block

__all__ = ["SAMPLES", "Sketched", "Survey", "limits", "survey", "through"]

SAMPLES = 9
"""Instants at which a rendered scene is sampled."""


@runtime_checkable
class Sketched(Protocol):
    """A source that provides samples, because rendering all of it would take long."""

    def sketch(self, cycles: int, samples: int) -> Sketch: ...


@dataclass(frozen=True, eq=False)
class Survey:
    """Range of the light of a run at every pixel.

    Attributes:
        least, most: limits over all instants, (H, W) lux.
        certain: (H, W) bool, whether these limits are proven.
        planes: new planes of light per cycle.
    """

    least: Plane
    most: Plane
    certain: npt.NDArray[np.bool_]
    planes: float

    @property
    def steady(self) -> npt.NDArray[np.bool_]:
        """(H, W) bool, whether the light is constant."""
        return np.asarray((self.least == self.most) & self.certain)


def _exact_survey(source: Source, clock: Clock, cycles: int) -> Survey:
    """The exact survey, from every piece of the run."""
    least: Plane | None = None
    most: Plane | None = None
    known_pieces: list[Piece] = []
    count = start = 0
    while start < cycles:
        light = source.step(None, Block(start, min(BLOCK, cycles - start)))
        for piece in light.pieces:
            if any(piece is known for known in known_pieces):
                continue
            met = [plane for known in known_pieces[-1:] for plane in (known.first, known.last)]
            known_pieces, count = [*known_pieces[-8:], piece], count + 1
            for plane in (piece.first,) if piece.constant else (piece.first, piece.last):
                if any(plane is one for one in met):  # the end of the piece before
                    continue
                least = plane.copy() if least is None else np.minimum(least, plane, out=least)
                most = plane.copy() if most is None else np.maximum(most, plane, out=most)
        # Light that extends beyond the block is not requested again.
        start = max(start + BLOCK, min(clock.cycle_at(light.pieces[-1].stop - 1), cycles))
    assert least is not None and most is not None  # a block has light
    return Survey(least, most, np.ones(least.shape, bool), (count - 1) / cycles)


def survey(source: Source, clock: Clock, cycles: int) -> Survey:
    """The survey of a run of `cycles` cycles. It consumes the source."""
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
    """The survey of light after a relay, which must preserve the order of levels."""

    def mapped(plane: Plane) -> Plane:
        piece = Piece(0, 1, plane, plane)
        return relay(Light((piece,))).pieces[0].first

    doubtful = mapped((~light.certain).astype(np.float32)) > 0
    return Survey(mapped(light.least), mapped(light.most), ~doubtful, light.planes)
