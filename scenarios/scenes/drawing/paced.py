"""Scenes that are still for most of a run and then too fast for one picture a cycle, as `Light`.

What a pixel gathers in a latch cycle is the mean of its light over it. Where an edge runs through
tens of pixels in a cycle, that mean is taken over so many pictures that no edge moves more than a
pixel from one to the next, and given out as constant light for that cycle: its integral is right,
only the order within the cycle is gone, and no more than a picture a cycle is kept.

A camera whose windows are not the clock's cycles, because its rows are sampled one after another,
its comparators are late or it has no latch, cuts a cycle in two. It is given PARTS means a cycle.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Protocol

import numpy as np

from cosim import PS, Block, Clock, Light, Piece, Plane
from cosim.light.source import Sketch
from scenarios.scenes.drawing.analytic import MOTION_STEP, AnalyticScene

__all__ = ["PARTS", "PacedScene", "PacedSource"]

PARTS = 4
"""Means in a cycle for windows that cut it. Each is a plane that a block of cycles holds."""


class PacedScene(AnalyticScene, Protocol):
    """An analytic scene that knows when it moves: `episodes`, (start, stop, speed) in seconds and
    pixels a second, in order and without overlap; between them nothing changes."""

    def episodes(self) -> list[tuple[float, float, float]]: ...


class PacedSource:
    """A paced scene under `illuminance` lux.

    A still time is one constant piece. A cycle of an episode in which edges move at most
    MOTION_STEP pixels is a linear piece; in a faster one, of n = ceil(motion / MOTION_STEP), the
    light is the mean by the trapezoidal rule over n + 1 pictures. Its error at a pixel is at most
    the total variation of the light there in that cycle over 2 n: between two pictures it is at
    most half of what the light varies by, for that long. A window that begins within a cycle of m
    means adds at most that variation over 4 m: a share f of a mean is off by f (1 - f) of what the
    light varies by in it. Nothing depends on how a run is split.

    aligned: whether windows are the clock's cycles. A cycle then is one piece, else PARTS of them.
    """

    def __init__(
        self, scene: PacedScene, illuminance: float, clock: Clock, aligned: bool = True
    ) -> None:
        self._scene, self._clock = scene, clock
        self._parts = 1 if aligned else PARTS
        self._lux = np.float32(illuminance)
        self.shape = scene.shape
        self._steps: dict[int, int] = {}
        for start, stop, speed in scene.episodes():
            n = max(1, math.ceil(speed / clock.hz / MOTION_STEP))
            first, last = (clock.cycle_at(round(t * PS)) for t in (start, stop))
            for cycle in range(first, last + 1):
                self._steps[cycle] = max(n, self._steps.get(cycle, 1))
        self._plane: tuple[int, Plane] = (-1, np.empty(0, np.float32))
        self._pieces: dict[int, list[Piece]] = {}
        self.degraded: list[str] = []
        self.notes = ["analytic scene that does not move"]
        if self._steps:
            low, high = min(self._steps), max(self._steps)
            self.notes = [
                f"analytic scene that moves from cycle {low} to {high}, by at most "
                f"{scene.speed() / clock.hz:.3g} pixels in one; drawn "
                f"{sum(self._steps.values())} times, so that no edge jumps by more than "
                f"{MOTION_STEP:g} pixel, and given to the camera as "
                f"{'a mean' if aligned else f'{PARTS} means'} a cycle where it is that fast"
            ]

    def _at(self, ps: int) -> Plane:
        """Light at an instant; the latest one is kept."""
        if self._plane[0] != ps:
            self._plane = (ps, self._scene.reflectance(ps / PS) * self._lux)
        return self._plane[1]

    def _moving(self, cycle: int) -> list[Piece]:
        n = self._steps[cycle]
        start, stop = self._clock.edge(cycle), self._clock.edge(cycle + 1)
        parts = min(n, self._parts)
        if n == parts:
            ends = [start + (stop - start) * k // n for k in range(n + 1)]
            return [Piece(a, b, self._at(a), self._at(b)) for a, b in pairwise(ends)]
        ends = [start + (stop - start) * k // parts for k in range(parts + 1)]
        return [self._mean(a, b, math.ceil(n / parts)) for a, b in pairwise(ends)]

    def _mean(self, start: int, stop: int, n: int) -> Piece:
        """The mean light from `start` to `stop` by the trapezoidal rule over n + 1 pictures."""
        knots = [start + (stop - start) * k // n for k in range(n + 1)]
        total = np.zeros(self.shape, np.float64)
        weights = np.zeros(n + 1)
        for k, (a, b) in enumerate(pairwise(knots)):
            weights[k : k + 2] += 0.5 * (b - a) / (stop - start)
        for knot, weight in zip(knots, weights, strict=True):
            total += weight * self._at(knot)
        mean = total.astype(np.float32)
        return Piece(start, stop, mean, mean)

    def _from(self, cycle: int) -> list[Piece]:
        """The pieces that begin with this cycle."""
        if cycle not in self._pieces:
            if cycle in self._steps:
                pieces = self._moving(cycle)
            else:
                start = self._clock.edge(cycle)
                after = min((c for c in self._steps if c > cycle), default=None)
                stop = 2**62 if after is None else self._clock.edge(after)
                plane = self._at(start)
                pieces = [Piece(start, stop, plane, plane)]
            self._pieces[cycle] = pieces
        return self._pieces[cycle]

    def _first(self, cycle: int) -> int:
        """The cycle with which the piece that holds this one begins."""
        if cycle in self._steps:
            return cycle
        return max((c + 1 for c in self._steps if c < cycle), default=0)

    def sketch(self, cycles: int, samples: int) -> Sketch:
        stop = self._clock.edge(cycles) / PS
        spans = [(a, min(b, stop), v) for a, b, v in self._scene.episodes() if a < stop]
        times = [0.0, stop]
        reach = 0.0
        for start, until, speed in spans:
            times += np.linspace(start, until, samples).tolist()
            reach = max(reach, speed * (until - start) / (2 * (samples - 1)) + MOTION_STEP)
        planes = [self._scene.reflectance(t) * self._lux for t in sorted(set(times))]
        box = self._scene.moving(0.0, stop)
        moving = sum(min(self._parts, n) for c, n in self._steps.items() if c < cycles)
        return Sketch(planes, reach, box, moving / cycles)

    def step(self, data: None, block: Block) -> Light:
        pieces: list[Piece] = []
        cycle = first = self._first(block.start)
        while cycle < block.stop:
            pieces += self._from(cycle)
            if pieces[-1].stop >= 2**62:
                break
            cycle = self._clock.cycle_at(pieces[-1].stop)
        self._pieces = {c: p for c, p in self._pieces.items() if c >= first}
        return Light(tuple(pieces))

    def truth(self, ps: int) -> Plane:
        return self._scene.reflectance(ps / PS)

    def points(self) -> list[tuple[int, int, str]]:
        return self._scene.points()
