"""Scenes in closed form, and the source that draws them block by block."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from cosim import PS, Block, Box, Clock, Light, Piece, Plane
from cosim.light.source import Sketch

__all__ = ["AnalyticScene", "AnalyticSource", "spread_points"]


class AnalyticScene(Protocol):
    """A scene in closed form: reflectance (H, W) float32 in [0, 1] at any instant (s), an upper
    bound of any edge's speed (pixels/s), the box that holds all change between two instants, and
    a few pixels worth looking at."""

    @property
    def shape(self) -> tuple[int, int]: ...
    def reflectance(self, t: float) -> Plane: ...
    def speed(self) -> float: ...
    def moving(self, start: float, stop: float) -> Box: ...
    def points(self) -> list[tuple[int, int, str]]: ...


MOTION_STEP = 1.0
"""Pixels that an edge may move between two instants at which an analytic scene is drawn; in
between, its light runs linearly. An edge then brings every pixel it passes the right light in all,
at the right time to half this step."""


class AnalyticSource:
    """An analytic scene under `illuminance` lux, drawn every few cycles of `clock`.

    Knots lie on whole cycles counted from 0, so they do not depend on how a run is split.
    """

    def __init__(self, scene: AnalyticScene, illuminance: float, clock: Clock) -> None:
        self._scene, self._clock = scene, clock
        self._lux = np.float32(illuminance)
        self.shape = scene.shape
        self.pursuit: float | None = getattr(scene, "pursuit", None)
        """Pixels a second along the rows that an eye follows, of a scene that says so."""
        speed = scene.speed()
        self._every = max(1, min(64, math.floor(MOTION_STEP * clock.hz / speed))) if speed else 0
        self._planes: dict[int, Plane] = {}
        self._pieces: dict[int, Piece] = {}
        self.degraded: list[str] = []
        self.notes = [
            f"analytic scene, drawn every {self._every} cycles (its edges move at most "
            f"{speed / clock.hz * self._every:.2g} pixels in that time), linear in between"
            if speed
            else "analytic scene that does not move"
        ]

    def _plane(self, cycle: int) -> Plane:
        if cycle not in self._planes:
            seconds = self._clock.edge(cycle) / PS
            self._planes = {c: p for c, p in self._planes.items() if c == cycle - self._every}
            self._planes[cycle] = self._scene.reflectance(seconds) * self._lux
        return self._planes[cycle]

    def _piece(self, cycle: int) -> Piece:
        """The piece that starts at this knot."""
        if cycle not in self._pieces:
            start, stop = self._clock.edge(cycle), self._clock.edge(cycle + self._every)
            box = self._scene.moving(start / PS, stop / PS)
            first = self._plane(cycle)
            piece = Piece(start, stop, first, self._plane(cycle + self._every), box)
            self._pieces = {c: p for c, p in self._pieces.items() if c >= cycle - self._every}
            self._pieces[cycle] = piece
        return self._pieces[cycle]

    def step(self, given: None, block: Block) -> Light:
        if not self._every:
            if not self._pieces:
                plane = self._plane(0)
                self._pieces[0] = Piece(0, 2**62, plane, plane)
            return Light((self._pieces[0],))
        first = block.start // self._every * self._every
        return Light(tuple(self._piece(c) for c in range(first, block.stop, self._every)))

    def truth(self, ps: int) -> Plane:
        return self._scene.reflectance(ps / PS)

    def sketch(self, cycles: int, samples: int) -> Sketch:
        stop = self._clock.edge(cycles) / PS
        if not self._every:
            return Sketch([self._plane(0)], 0.0, (0, 0, 0, 0), 0.0)
        times = np.linspace(0, stop, samples)
        planes = [self._scene.reflectance(float(t)) * self._lux for t in times]
        reach = self._scene.speed() * stop / (2 * (samples - 1)) + MOTION_STEP
        return Sketch(planes, reach, self._scene.moving(0.0, stop), 1 / self._every)

    def points(self) -> list[tuple[int, int, str]]:
        return self._scene.points()


def spread_points(shape: tuple[int, int], n: int = 10) -> list[tuple[int, int, str]]:
    """Pixels spread over a plane, for scenes that name none: low-discrepancy (R2) sequence."""
    height, width = shape
    g = 1.32471795724474602596  # plastic number: its powers space the points evenly
    places = [
        (int(height * ((0.5 + i / g) % 1)), int(width * ((0.5 + i / g**2) % 1)))
        for i in range(1, n + 1)
    ]
    return [(row, column, f"row {row}, column {column}") for row, column in places]
