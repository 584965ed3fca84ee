"""Scenes in closed form, and the source that draws them for a run; pixels for the figures of scenes
without characteristic points; a scene without colours before a filter array."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from cosim import PS, Block, Box, Clock, Light, Piece, Plane
from cosim.light.light import PlaneMap
from cosim.light.mosaic import Mosaic
from cosim.light.source import Points, Sketch, Source

MOTION_STEP = 1.0
"""Largest motion of an edge between two instants at which an analytic scene is drawn, pixels. The
light in between is interpolated linearly. A pixel that an edge passes then receives the correct
total light, with an error in time of at most half this step."""


def spread_points(shape: tuple[int, int], n: int = 10) -> list[tuple[int, int, str]]:
    """`n` pixels spread evenly over a plane by the R2 sequence: row, column, name."""
    height, width = shape
    g = 1.32471795724474602596  # plastic number: its powers space the points evenly
    places = [
        (int(height * ((0.5 + i / g) % 1)), int(width * ((0.5 + i / g**2) % 1)))
        for i in range(1, n + 1)
    ]
    return [(row, column, f"row {row}, column {column}") for row, column in places]


class AnalyticScene(Protocol):
    """A scene in closed form.

    Attributes:
        shape: (rows, columns).
    """

    @property
    def shape(self) -> tuple[int, int]: ...

    def reflectance(self, t: float) -> Plane:
        """Reflectance at the instant `t`, s, (H, W) float32 in [0, 1]."""
        ...

    def speed(self) -> float:
        """Upper bound of the speed of any edge, pixels/s."""
        ...

    def moving(self, start: float, stop: float) -> Box:
        """Box (y0, y1, x0, x1) that contains all changes between two instants, s."""
        ...

    def points(self) -> list[tuple[int, int, str]]:
        """Pixels for figures: row, column, name."""
        ...


class AnalyticSource:
    """An analytic scene as the `Source` of a run, drawn every few cycles. The instants are
    multiples from cycle 0, so they do not depend on the blocks of a run.

    Attributes:
        pursuit: speed along the rows that an eye follows, pixels/s; None without one.
    """

    def __init__(self, scene: AnalyticScene, illuminance: float, clock: Clock) -> None:
        self._scene, self._clock = scene, clock
        self._lux = np.float32(illuminance)
        self.shape = scene.shape
        self.pursuit: float | None = getattr(scene, "pursuit", None)
        speed = scene.speed()
        self._every = max(1, min(64, math.floor(MOTION_STEP * clock.hz / speed))) if speed else 0
        self._planes: dict[int, Plane] = {}
        self._pieces: dict[int, Piece] = {}
        self.degraded: list[str] = []
        every = "cycle" if self._every == 1 else f"{self._every} cycles"
        self.notes = [
            f"analytic scene, drawn every {every} "
            f"(its edges move by {speed / clock.hz * self._every:.2g} px or less in that time), "
            "linear in between"
            if speed
            else "static analytic scene"
        ]

    def _plane(self, cycle: int, changed: Box | None = None) -> Plane:
        """The light at the start of a cycle, lux. changed: box outside which it is that of the
        previous instant, None if unknown."""
        if cycle not in self._planes:
            seconds, before = self._clock.edge(cycle) / PS, self._planes.get(cycle - self._every)
            patch = getattr(self._scene, "patch", None)
            if changed is None or before is None or patch is None:
                plane = self._scene.reflectance(seconds) * self._lux
            else:
                plane = before.copy()
                y0, y1, x0, x1 = changed
                plane[y0:y1, x0:x1] = patch(seconds, changed) * self._lux
            self._planes = {c: p for c, p in self._planes.items() if c == cycle - self._every}
            self._planes[cycle] = plane
        return self._planes[cycle]

    def _piece(self, cycle: int) -> Piece:
        """The piece that starts at this cycle, which is a multiple of `_every`."""
        if cycle not in self._pieces:
            start, stop = self._clock.edge(cycle), self._clock.edge(cycle + self._every)
            box = self._scene.moving(start / PS, stop / PS)
            first = self._plane(cycle)
            piece = Piece(start, stop, first, self._plane(cycle + self._every, box), box)
            self._pieces = {c: p for c, p in self._pieces.items() if c >= cycle - self._every}
            self._pieces[cycle] = piece
        return self._pieces[cycle]

    def step(self, data: None, block: Block) -> Light:
        if not self._every:
            if not self._pieces:
                plane = self._plane(0)
                self._pieces[0] = Piece(0, 2**62, plane, plane)
            return Light((self._pieces[0],))
        first = block.start // self._every * self._every
        return Light(tuple(self._piece(c) for c in range(first, block.stop, self._every)))

    def truth(self, ps: int) -> Plane:
        return self._scene.reflectance(ps / PS)

    def truth_at(self, ps: int, points: Points) -> list[float]:
        """See `cosim.light.source.truth_at`."""
        patch = getattr(self._scene, "patch", None)
        if patch is None:
            plane = self.truth(ps)
            return [float(plane[row, column]) for row, column, _ in points]
        return [float(patch(ps / PS, (y, y + 1, x, x + 1))[0, 0]) for y, x, _ in points]

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


class NeutralSource:
    """A `Source` whose light is white: each pixel has the signal of its filter under white."""

    def __init__(self, source: Source, mosaic: Mosaic) -> None:
        self._source = source
        self._share = mosaic.neutral(source.shape)
        self._signal = self._share * np.float32(mosaic.white)
        self._map = PlaneMap(self._behind, 0)

    def _behind(self, plane: Plane) -> Plane:
        return plane * self._signal

    def __getattr__(self, name: str) -> Any:
        """Everything else is the scene's. A sketch, if it has one, has planes behind filters."""
        found = getattr(self._source, name)
        if name != "sketch":
            return found

        def sketch(*given: Any) -> Sketch:
            made: Sketch = found(*given)
            return replace(made, planes=[self._behind(plane) for plane in made.planes])

        return sketch

    def step(self, data: None, block: Block) -> Light:
        return self._map(self._source.step(data, block))

    def truth(self, ps: int) -> Plane:
        return self._source.truth(ps) * self._share
