"""A run's display: the panel, its renderer, who looks, and the panels beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Clock
from cosim.compute.opencl import Device
from cosim.light.source import Source
from display import STAGES, DisplaySetting, Observer, SpikePanel, eye_time, fit_words, make_renderer
from display.observe.beside import TRUTH, BesideStage
from display.observe.pursuit import pursuit_speed
from display.observe.showing import beside_of, observers_of
from display.observe.slow_motion import SlowMotion
from display.observe.stage import DisplayStage
from display.observe.tap import LightTap
from display.section import DisplaySection
from scenarios.assemble.probes import Probes, probe_display
from scenarios.assemble.scenario import Scenario
from sensor import CameraSetting

__all__ = ["SPIKE", "Glass", "follow", "make_glass"]

SPIKE = "spike"
"""Name of the spike-continuous display among the panels."""
MOTION = 1.0
"""Pixels that light may move on a pursuing eye's retina within a span of planes: with 0.5 the eye's
PSNR of `glass` is the same to 0.1 dB."""
FRAMES = 160
"""Of the slow motion, at most."""
TILE = 400
"""Pixels of the longer side of a display's picture in it, at most."""


@dataclass(frozen=True, eq=False)
class Glass:
    """Everything of a run's display.

    observers: by name. velocity: of the pursuing eye, pixels a second along the rows; told: where
    it is from. points: pixels worth looking at, (row, column, what), whose light `tap` keeps.
    """

    section: DisplaySection
    setting: DisplaySetting
    observers: dict[str, Observer]
    velocity: float
    told: str
    motion: SlowMotion
    points: list[tuple[int, int, str]]
    shown: DisplayStage
    beside: BesideStage
    tap: LightTap

    @property
    def panel(self) -> SpikePanel:
        return self.setting.panel

    def stages(self, stages: dict[str, Any]) -> dict[str, Any]:
        """A run's stages with the display's: beside after the scene, the display last."""
        out: dict[str, Any] = {}
        for name, stage in stages.items():
            out[name] = stage
            if name == "scene":
                out |= {"tap": self.tap, "beside": self.beside}
        return out | {"display": self.shown}

    def seen(self) -> dict[str, dict[str, npt.NDArray[np.float32]]]:
        """By display and observer: (images, height, width), white = 1; after the last block."""
        seen = {
            name: {who: self._on_panel(images) for who, images in views.items()}
            for name, views in self.beside.images().items()
        }
        return {TRUTH: seen.pop(TRUTH), SPIKE: self.shown.images} | seen

    def _on_panel(self, images: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Pictures of the scene's pixels on those of the panel, as its words are."""
        scene, panel = images.shape[1:], self.panel.shape
        if scene == panel:
            return images
        fitted = fit_words(self.section.fit, scene, panel)(images.view(np.uint32))
        return fitted.view(np.float32)

    def frames(self) -> dict[str, npt.NDArray[np.uint8]]:
        """The slow motion by display; after the last block."""
        films = dict(self.beside.films)
        if self.shown.film is not None:
            films = {TRUTH: films.pop(TRUTH), SPIKE: self.shown.film} | films
        return {name: film.frames for name, film in films.items()}

    def identity(self) -> str:
        """Text that names what a checkpoint of it depends on beyond the scenario."""
        return f"{self.shown.renderer.name} {self.setting}"

    def probes(self, camera: CameraSetting, device: Device | None) -> Probes:
        """Latency, blur and flicker of its panels, with this camera before them."""
        return probe_display(
            camera, self.panel, beside_of(self.section), device, camera.seed,
            per_degree=self.section.distance, pst_lm=True,
        )  # fmt: skip

    def close(self) -> None:
        """Gives the renderer back."""
        self.shown.close()


def _motion(clock: Clock, cycles: int, every: int, shape: tuple[int, int]) -> SlowMotion:
    """The slow motion of a run, `every` cycles to an exposure. What is left over at the start is
    not shown, where a panel is dark in any case."""
    first = cycles % every
    exposure = (clock.edge(cycles) - clock.edge(first)) // (cycles // every)
    return SlowMotion(
        shape, clock.edge(first), clock.edge(cycles), exposure, -(-max(shape) // TILE)
    )


def follow(scenario: Scenario, source: Source, end: int) -> tuple[float, str]:
    """What the pursuing eye follows, pixels of the scene a second to the right, and where that is
    from. end: of the run, ps."""
    if scenario.display is not None and scenario.display.pursuit is not None:
        speed = scenario.display.pursuit
        return speed, f"the pursuing eye follows {speed:g} pixels/s"
    return pursuit_speed(source, end)


def short_of(luminance: float, seconds: float) -> list[str]:
    """What a user must know of a run that is shorter than the eye's response (two standard
    deviations of it on either side)."""
    whole = 4 * math.sqrt(STAGES) * eye_time(luminance)
    if seconds >= whole:
        return []
    return [
        f"the run is shorter than the {whole * 1e3:.2g} ms that an eye takes together: what eyes "
        "see is the light there was"
    ]


def _spans(setting: DisplaySetting, velocity: float, every: int) -> DisplaySetting:
    """The setting with spans short enough for the pursuing eye, on whose retina light may move by
    MOTION within one, and for the slow motion, of `every` planes an exposure."""
    batch, step = setting.batch, abs(velocity) / setting.panel.clock.hz
    while batch > 1 and (batch * step > MOTION or 2 * batch > every):
        batch //= 2
    return replace(setting, batch=batch)


def make_glass(
    scenario: Scenario,
    camera: CameraSetting,
    cycles: int,
    instants: Sequence[int],
    planned: DisplaySetting,
    pursuit: tuple[float, str],
    points: list[tuple[int, int, str]],
) -> Glass:
    """The run's display. instants: cycles. planned: the panel as it is shown. pursuit: as `follow`
    gives it. points: pixels of the scene worth looking at.

    Raises InputError where it cannot be shown: a panel of another size, no OpenGL.
    """
    section = scenario.display
    assert section is not None
    clock, velocity = camera.clock, pursuit[0]
    scene, panel = (camera.chip.height, camera.chip.width), planned.panel.shape
    at, end = [clock.middle(n) for n in instants], clock.edge(cycles)

    def looking(speed: float) -> dict[str, Observer]:
        wanted = ("eye", "pursuit", section.observer)
        made = observers_of(section, at, end, speed)
        return {name: observer for name, observer in made.items() if name in wanted}

    # A panel that shows the whole picture in other pixels has it move at another speed.
    ratio = panel[1] / scene[1] if section.fit == "nearest" else 1.0
    every = -(-cycles // FRAMES)
    setting = _spans(planned, velocity * ratio, every)
    shown = DisplayStage(
        setting, looking(velocity * ratio), _motion(clock, cycles, every, panel), cycles,
        lambda images: make_renderer(section.renderer, setting.panel, setting.batch, images),
        None if panel == scene else fit_words(section.fit, scene, panel),
    )  # fmt: skip
    observers, motion = looking(velocity), _motion(clock, cycles, every, scene)
    white = scenario.scene.illuminance
    beside = BesideStage(beside_of(section), observers, scene, white, clock, cycles, motion)
    tap = LightTap([(row, column) for row, column, _ in points], clock, white)
    return Glass(section, setting, observers, *pursuit, motion, points, shown, beside, tap)
