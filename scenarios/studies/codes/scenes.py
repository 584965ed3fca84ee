"""The scenes of the bench, from static to entirely moving, on a small grid.

The share of pixels whose light changes in a given time does not depend on the resolution: on a grid
n times coarser, edges cover an n times larger share of the pixels and move n times slower.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cosim import Box, Clock, Plane, Viform
from cosim.compute.opencl import Device
from cosim.light.source import Source
from cosim.stage import blocks
from scenarios.scenes.catalogue import SceneSection
from scenarios.scenes.drawing.analytic import AnalyticSource
from scenarios.scenes.kinds.film import FilmScene
from scenarios.scenes.kinds.grid import SceneGrid
from scenarios.scenes.kinds.star import StarScene
from scenarios.scenes.kinds.step import StepScene
from scenarios.scenes.kinds.wave import WaveScene
from sensor import CHIPS, EFFECTS, CameraSetting, SpikeCamera
from sensor.latched.effects import SHOT_NOISE

SHAPE = (96, 128)
CYCLES = 2560
CLOCK = Clock(40_000)
WHITE = 0.6
"""Spike rate of white, spikes a cycle."""
SCENES = {
    "step": "still: grey bars, after their step",
    "workbench": "a fan, a disc and a ball on a still bench",
    "wave": "a person waves an arm",
    "star": "a turning star in a still chart",
    "pan": "everything moves: a texture that pans",
}


class Pan:
    """A texture of gratings in three directions that moves along the rows at `speed`, pixels/s;
    implements `AnalyticScene`."""

    def __init__(self, shape: tuple[int, int], speed: float = 800.0) -> None:
        self.shape, self._speed = shape, speed
        self._y, self._x = (g.astype(np.float32) for g in np.mgrid[: shape[0], : shape[1]])

    def reflectance(self, t: float) -> Plane:
        x = self._x + np.float32(self._speed * t)
        waves = sum(np.sin(2 * np.pi * (x * u + self._y * v)) for u, v in _GRATINGS)
        return np.asarray(0.5 + 0.48 / len(_GRATINGS) * waves, np.float32)

    def speed(self) -> float:
        return self._speed

    def moving(self, start: float, stop: float) -> Box:
        return (0, self.shape[0], 0, self.shape[1])

    def points(self) -> list[tuple[int, int, str]]:
        return [(0, 0, "a corner")]


_GRATINGS = ((1 / 31, 1 / 47), (1 / 17, -1 / 53), (1 / 71, 1 / 11))
"""Frequencies of the gratings along rows and columns, cycles per pixel. All have a component along
the motion, so that every pixel changes."""


def camera(threshold: float, shot: bool) -> CameraSetting:
    """The camera of the bench: the pixel of SpikeTwo on a small grid, with or without shot
    noise."""
    chip = replace(CHIPS["spiketwo"], width=SHAPE[1], height=SHAPE[0])
    effects = tuple(e for e in EFFECTS.values() if shot or e is not SHOT_NOISE)
    return CameraSetting(chip, CLOCK, threshold, 1, effects=effects)


def open_scene(name: str, setting: CameraSetting) -> Source:
    """A scene under the light at which white fires at WHITE."""
    lux = WHITE / setting.rate(1.0)
    light = {"illuminance": f"{lux!r} lux"}
    if name == "pan":
        return AnalyticSource(Pan(SHAPE), lux, CLOCK)
    sections: dict[str, Callable[[], SceneSection]] = {
        "step": lambda: StepScene.model_validate({"kind": "step", "at": "0 s", **light}),
        "workbench": lambda: FilmScene.model_validate(light),
        "wave": lambda: WaveScene.model_validate({"kind": "wave", **light}),
        "star": lambda: StarScene.model_validate({"kind": "star", **light}),
    }
    return sections[name]().source(SceneGrid(SHAPE, CLOCK, CYCLES))


def film(source: Source, setting: CameraSetting, device: Device | None) -> Viform:
    """The whole stream of a scene."""
    lens_free = SpikeCamera(setting, device)
    parts = [lens_free.step(source.step(None, block), block).words for block in blocks(CYCLES)]
    return Viform(np.concatenate(parts), CYCLES, CLOCK)


def truth(source: Source, cycle: int) -> Plane:
    """Reflectance in the middle of a cycle, (H, W)."""
    return source.truth(CLOCK.middle(cycle))
