"""Test light of the probes: steady, stepped in time, and a moving edge."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cosim import Clock, Light, Piece
from display.panels.panel import SpikePanel

__all__ = ["edge_light", "phased_light", "settling_cycles", "steady_light"]

Places = npt.NDArray[np.int64]


def _plane(shape: tuple[int, int], lux: float) -> npt.NDArray[np.float32]:
    return np.full(shape, lux, np.float32)


def steady_light(shape: tuple[int, int], lux: float, stop: int) -> Light:
    """The same light everywhere, to `stop` (ps)."""
    plane = _plane(shape, lux)
    return Light((Piece(0, stop, plane, plane),))


def phased_light(
    shape: tuple[int, int], before: float, after: float, at: Places, stop: int
) -> Light:
    """Light (lux) that jumps in each column at its own instant `at`, (width,) ps rising."""
    height, width = shape
    marks = [0, *(int(t) for t in at), stop]
    pieces = []
    for column in range(width + 1):
        plane = _plane((height, width), before)
        plane[:, :column] = after
        pieces.append(Piece(marks[column], marks[column + 1], plane, plane))
    return Light(tuple(pieces))


def edge_light(
    shape: tuple[int, int], ahead: float, behind: float, speed: float, clock: Clock, cycles: int
) -> Light:
    """An edge that enters at the left at instant 0 and moves right at `speed` pixels a second, for
    `cycles` cycles: `behind` it one light, `ahead` the other (lux).

    A pixel gathers over its whole area, so while the edge crosses it its light runs linearly: what
    falls on the pixels is exact at every instant.
    """
    stop = clock.edge(cycles)
    height, width = shape
    ps = 10**12 / speed  # to cross a pixel

    def plane(column: int) -> npt.NDArray[np.float32]:
        values = _plane((height, width), ahead)
        values[:, :column] = behind
        return values

    pieces, now, column = [], plane(0), 0
    while round(column * ps) < stop and column < width:
        later = plane(column + 1)
        box = (0, height, column, column + 1)
        pieces.append(Piece(round(column * ps), round((column + 1) * ps), now, later, box))
        now, column = later, column + 1
    if pieces[-1].stop < stop:
        pieces.append(Piece(pieces[-1].stop, stop, now, now))
    return Light(tuple(pieces))


def settling_cycles(panel: SpikePanel) -> int:
    """Cycles after which an emitter's light is its drive's to 5e-5."""
    return math.ceil(10 * max(panel.rise, panel.decay) * panel.clock.hz)
