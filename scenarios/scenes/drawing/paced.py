"""Light of scenes that are static for most of a run and then too fast for one picture a cycle.

A pixel integrates the mean of its light over a latch cycle. If an edge moves by tens of pixels in a
cycle, this mean is computed over several pictures, such that no edge moves by more than a pixel
between them, and used as constant light for the cycle. The integral is correct; only the order
within the cycle is lost, and only one picture a cycle is stored.

A camera whose integration windows are not the clock cycles (sequential rows, delayed comparators,
no latch) splits a cycle. It gets PARTS means in a cycle.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Protocol

import numpy as np

from cosim import PS, Block, Clock, Light, Piece, Plane
from cosim.light.source import Sketch
from scenarios.scenes.drawing.analytic import MOTION_STEP, AnalyticScene

PARTS = 4
"""Number of means in a cycle for windows that split it. Each is a plane in memory."""
MANY = 1024
"""Number of pictures of a cycle from which on those of its still parts are left out."""


def _divided(start: int, stop: int, n: int) -> list[int]:
    """The n + 1 instants, ps, that divide a time into n equal parts."""
    return [start + (stop - start) * k // n for k in range(n + 1)]


class PacedScene(AnalyticScene, Protocol):
    """An analytic scene that knows when it moves."""

    def episodes(self) -> list[tuple[float, float, float]]:
        """Intervals of motion (start, s; stop, s; greatest speed, pixels/s), in order and without
        overlap. The scene is static between them."""
        ...


class PacedSource:
    """A paced scene as the `Source` of a run.

    A static interval is one constant piece. A cycle of an episode in which edges move by at most
    MOTION_STEP pixels is a linear piece. In a faster cycle, with n = ceil(motion / MOTION_STEP),
    the light is the mean by the trapezoidal rule over n + 1 pictures. Its error at a pixel is at
    most the total variation of the light in that cycle over 2 n: between two pictures it is at most
    half of the variation, for their interval. A window that starts within a cycle of m means adds
    at most the variation over 4 m: the error of a share f of a mean is f (1 - f) of the variation
    in it. The light does not depend on the blocks of a run. A cycle so long that n would exceed
    MANY is divided where the motion begins, ends, or changes its speed, and each part has its own
    n.

    Args:
        scene: the scene.
        illuminance: illuminance of the scene, lux.
        clock: latch clock.
        aligned: whether the windows are the clock cycles. A cycle is then one piece, else PARTS.
    """

    def __init__(
        self, scene: PacedScene, illuminance: float, clock: Clock, aligned: bool = True
    ) -> None:
        self._scene, self._clock = scene, clock
        self._parts = 1 if aligned else PARTS
        self._lux = np.float32(illuminance)
        self.shape = scene.shape
        self._episodes = [(round(a * PS), round(b * PS), v) for a, b, v in scene.episodes()]
        self._steps: dict[int, int] = {}
        for start, stop, speed in self._episodes:
            n = max(1, math.ceil(speed / clock.hz / MOTION_STEP))
            for cycle in range(clock.cycle_at(start), clock.cycle_at(stop) + 1):
                self._steps[cycle] = max(n, self._steps.get(cycle, 1))
        self._long = {cycle for cycle, n in self._steps.items() if n > MANY}
        for cycle in self._long:
            self._steps[cycle] = len(self._knots(clock.edge(cycle), clock.edge(cycle + 1))) - 1
        self._plane: tuple[int, Plane] = (-1, np.empty(0, np.float32))
        self._pieces: dict[int, list[Piece]] = {}
        self.degraded: list[str] = []
        self.notes = ["static analytic scene"]
        if self._steps:
            low, high = min(self._steps), max(self._steps)
            self.notes = [
                f"analytic scene that moves from cycle {low} to {high}, by at most "
                f"{scene.speed() / clock.hz:.3g} pixels in a cycle; drawn "
                f"{sum(self._steps.values())} times, so that no edge jumps by more than "
                f"{MOTION_STEP:g} pixel; the camera gets "
                f"{'one mean' if aligned else f'{PARTS} means'} in each fast cycle"
            ]

    def _at(self, ps: int) -> Plane:
        """Light at an instant, lux; the latest plane is cached."""
        if self._plane[0] != ps:
            self._plane = (ps, self._scene.reflectance(ps / PS) * self._lux)
        return self._plane[1]

    def _moving(self, cycle: int) -> list[Piece]:
        n = self._steps[cycle]
        start, stop = self._clock.edge(cycle), self._clock.edge(cycle + 1)
        if cycle in self._long:
            ends = _divided(start, stop, self._parts)
            return [self._mean(self._knots(a, b)) for a, b in pairwise(ends)]
        parts = min(n, self._parts)
        ends = _divided(start, stop, parts)
        if n == parts:
            return [Piece(a, b, self._at(a), self._at(b)) for a, b in pairwise(ends)]
        n = math.ceil(n / parts)
        return [self._mean(_divided(a, b, n)) for a, b in pairwise(ends)]

    def _knots(self, start: int, stop: int) -> list[int]:
        """Instants from `start` to `stop`, ps, between which no edge moves by more than
        MOTION_STEP."""
        ends = {t for a, b, _ in self._episodes for t in (a, b) if start < t < stop}
        knots = [start]
        for a, b in pairwise(sorted({start, stop, *ends})):
            speed = max((v for e, f, v in self._episodes if e <= a and b <= f), default=0.0)
            n = max(1, math.ceil(speed * (b - a) / PS / MOTION_STEP))
            knots += _divided(a, b, n)[1:]
        return knots

    def _mean(self, knots: list[int]) -> Piece:
        """The mean light from the first to the last of these instants by the trapezoidal rule."""
        start, stop = knots[0], knots[-1]
        total = np.zeros(self.shape, np.float64)
        weights = np.zeros(len(knots))
        for k, (a, b) in enumerate(pairwise(knots)):
            weights[k : k + 2] += 0.5 * (b - a) / (stop - start)
        for knot, weight in zip(knots, weights, strict=True):
            total += weight * self._at(knot)
        mean = total.astype(np.float32)
        return Piece(start, stop, mean, mean)

    def _from(self, cycle: int) -> list[Piece]:
        """The pieces that start with this cycle."""
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
        """The first cycle of the piece that contains this cycle."""
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
