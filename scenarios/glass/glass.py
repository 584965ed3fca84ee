"""A run's display: the panel, its renderer, who looks, and the panels beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Clock
from cosim.opencl import Device
from display import Observer, PlainRenderer, SpikePanel
from display.setting import DisplaySetting
from scenarios.beside import TRUTH, BesideStage
from scenarios.glass.stage import DisplayStage, Renderer
from scenarios.glass.tap import LightTap
from scenarios.probes import Probes, probe_display
from scenarios.pursuit import pursuit_speed
from scenarios.scenes import Source
from scenarios.schema import Scenario
from scenarios.schema.display import DisplaySection
from scenarios.showing import beside_of, observers_of, panel_of
from scenarios.slow_motion import SlowMotion
from sensor import CameraSetting

__all__ = ["Glass", "make_glass"]

SPIKE = "spike"
"""Name of the spike-continuous display among the panels."""
BATCH = 8
"""Planes to a span of light: a fifth of a millisecond at 40 kHz, far below what an eye resolves."""
FRAMES = 160
"""Of the slow motion, at most."""
TILE = 480
"""Pixels of the longer side of a display's picture in it, at most."""


@dataclass(frozen=True, eq=False)
class Glass:
    """Everything of a run's display.

    observers: by name. velocity: of the pursuing eye, pixels a second along the rows. points:
    pixels worth looking at, (row, column, what), whose light `tap` keeps.
    """

    section: DisplaySection
    setting: DisplaySetting
    observers: dict[str, Observer]
    velocity: float
    notes: list[str]
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
        seen = self.beside.images()
        return {TRUTH: seen.pop(TRUTH), SPIKE: self.shown.images} | seen

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
            per_degree=self.section.distance,
        )  # fmt: skip

    def close(self) -> None:
        """Gives the renderer back."""
        self.shown.close()


def _renderer(kind: str, panel: SpikePanel, batch: int, images: int) -> Renderer:
    if kind == "numpy":
        return PlainRenderer(panel, batch, images)
    from display.renderer import Renderer as Drawn  # brings GL with it

    return Drawn(panel, batch, images)


def _motion(clock: Clock, cycles: int, shape: tuple[int, int]) -> SlowMotion:
    """The slow motion of a run: whole cycles to an exposure. What is left over at the start is not
    shown, where a panel is dark in any case."""
    every = -(-cycles // FRAMES)
    first = cycles % every
    exposure = (clock.edge(cycles) - clock.edge(first)) // (cycles // every)
    return SlowMotion(
        shape, clock.edge(first), clock.edge(cycles), exposure, -(-max(shape) // TILE)
    )


def make_glass(
    scenario: Scenario,
    camera: CameraSetting,
    cycles: int,
    instants: Sequence[int],
    white_rate: float,
    source: Callable[[], Source],
) -> Glass | None:
    """The run's display; None where the scenario has none. instants: cycles. source: the scene once
    more.

    Raises InputError where it cannot be shown: a panel of another size, no OpenGL.
    """
    section = scenario.display
    if section is None:
        return None
    panel = panel_of(section, camera, white_rate)
    clock: Clock = camera.clock
    scene = source()
    if section.pursuit is None:
        velocity, told = pursuit_speed(scene, clock.edge(cycles))
    else:
        velocity, told = section.pursuit, f"the pursuing eye follows {section.pursuit:g} pixels/s"
    at = [clock.middle(n) for n in instants]
    observers: dict[str, Observer] = {}
    for name, observer in observers_of(section, at, clock.edge(cycles), velocity).items():
        if name in ("eye", "pursuit", section.observer):
            observers[name] = observer
    setting = DisplaySetting(panel, observers[section.observer], BATCH, True)
    motion = _motion(clock, cycles, panel.shape)
    shown = DisplayStage(
        setting, observers, motion, cycles,
        lambda images: _renderer(section.renderer, panel, setting.batch, images),
    )  # fmt: skip
    white = scenario.scene.illuminance
    beside = BesideStage(
        beside_of(section), observers, (camera.chip.height, camera.chip.width), white, clock,
        cycles, motion,
    )  # fmt: skip
    tap = LightTap([(row, column) for row, column, _ in scene.points()], clock, white)
    return Glass(
        section, setting, observers, velocity, [told], motion, scene.points(), shown, beside, tap
    )
