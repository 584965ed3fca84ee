"""A static test chart or picture under light that varies piecewise linearly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim import Block, InputError, Light, Piece, Plane, seconds_to_ps
from cosim.light.charts import PAPER, draw
from imagers.common.scenery import Course
from scenarios.scenes.clips.pictures import open_clip
from scenarios.scenes.drawing.analytic import spread_points

_FOREVER = 2**62
"""End of the last piece of light, ps."""


class ChartScene(Protocol):
    """The parameters of a chart scene, as in its section.

    Attributes:
        illuminance: illuminance at a factor of 1, lux.
        chart: name of a drawn chart.
        contrast: factor of the contrast with the grey of the sheet.
        path: picture instead of the chart; None for a drawn chart.
        course: knots of the light, (time in s, factor), in order.
    """

    @property
    def illuminance(self) -> float: ...
    @property
    def chart(self) -> str: ...
    @property
    def contrast(self) -> float: ...
    @property
    def path(self) -> str | None: ...
    @property
    def course(self) -> tuple[tuple[float, float], ...]: ...


def target_plane(scene: ChartScene, shape: tuple[int, int]) -> npt.NDArray[np.float64]:
    """Reflectance of the chart or picture on a grid of `shape`, (H, W) in [0, 1]."""
    if scene.path is not None:
        clip = open_clip(Path(scene.path), shape, rate=1.0)  # by which one of several is told
        if clip.rate:
            raise InputError(
                "scene.path", "a picture in a scene of kind target", f"{scene.path}, which moves",
                "leave it out, give one picture, or film it with scene.kind = film",
            )  # fmt: skip
        plane = np.asarray(clip.frame(0), np.float64)
        if plane.max() > 1:
            raise InputError(
                "scene.path", "a picture of reflectances up to 1 in a scene of kind target",
                f"{scene.path} (up to {plane.max():.3g})",
                "leave it out, or film it with scene.kind = film",
            )  # fmt: skip
    else:
        plane = draw(scene.chart, shape)
    if scene.contrast == 1.0:
        return plane
    return np.asarray(PAPER + (plane - PAPER) * scene.contrast)


def target_course(scene: ChartScene) -> Course:
    """The factor of the light over time."""
    return Course(tuple((seconds_to_ps(time), factor) for time, factor in scene.course))


@dataclass
class TargetSource:
    """The chart as the `Source` of a run."""

    scene: ChartScene
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        self.notes = [f"a static chart; its light has {len(self.scene.course)} knots"]
        self.degraded: list[str] = []
        self._course = target_course(self.scene)
        self._plane = target_plane(self.scene, self.shape)

    @cached_property
    def light(self) -> Light:
        """The light of the whole run, with one piece between two knots."""
        lux = self._plane * self.scene.illuminance

        def plane(factor: float) -> Plane:
            return (lux * factor).astype(np.float32)

        knots = self._course.knots
        pieces = []
        if knots[0][0] > 0:
            first = plane(knots[0][1])
            pieces.append(Piece(0, knots[0][0], first, first))
        for (t0, f0), (t1, f1) in pairwise(knots):
            if t1 > t0:
                start = plane(f0)
                pieces.append(Piece(t0, t1, start, start if f0 == f1 else plane(f1)))
        last = plane(knots[-1][1])
        pieces.append(Piece(knots[-1][0], _FOREVER, last, last))
        return Light(tuple(pieces))

    def step(self, data: None, block: Block) -> Light:
        return self.light

    def truth(self, ps: int) -> Plane:
        """Reflectance times the factor of the light at that instant."""
        return (self._plane * self._course.at(ps)).astype(np.float32)

    def points(self) -> list[tuple[int, int, str]]:
        return spread_points(self.shape)
