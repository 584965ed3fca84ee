"""A run's display: the panel, its renderer, who looks, and the panels beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Clock
from display import Observer, PlainRenderer, SpikePanel
from display.setting import DisplaySetting
from scenarios.glass.slow import SlowMotion, slow_motion
from scenarios.glass.stage import DisplayStage, Renderer
from scenarios.scenes import Source
from scenarios.schema import Scenario
from scenarios.schema.display import DisplaySection
from scenarios.showing import observers_of, panel_of
from sensor import CameraSetting

__all__ = ["Glass", "make_glass"]

BATCH = 8
"""Planes to a span of light: a fifth of a millisecond at 40 kHz, far below what an eye resolves."""


@dataclass(frozen=True, eq=False)
class Glass:
    """Everything of a run's display."""

    section: DisplaySection
    setting: DisplaySetting
    observers: dict[str, Observer]
    velocity: float
    slow: SlowMotion
    shown: DisplayStage
    beside: Any

    @property
    def panel(self) -> SpikePanel:
        return self.setting.panel

    def stages(self, stages: dict[str, Any]) -> dict[str, Any]:
        """A run's stages with the display's: beside after the scene, the display last."""
        out: dict[str, Any] = {}
        for name, stage in stages.items():
            out[name] = stage
            if name == "scene" and self.beside is not None:
                out["beside"] = self.beside
        return out | {"display": self.shown}

    def seen(self) -> dict[str, dict[str, npt.NDArray[np.float32]]]:
        """By display and observer: (images, height, width), white = 1; after the last block."""
        return {"spike": self.shown.images}

    def frames(self) -> dict[str, npt.NDArray[np.uint8]]:
        """The slow motion by display; after the last block."""
        return {"spike": self.shown.frames}

    def identity(self) -> str:
        """Text that names what a checkpoint of it depends on beyond the scenario."""
        return f"{self.shown.renderer.name} {self.setting}"

    def close(self) -> None:
        """Gives the renderer back."""
        self.shown.renderer.close()


def _renderer(kind: str, panel: SpikePanel, batch: int, images: int) -> Renderer:
    return PlainRenderer(panel, batch, images)


def make_glass(
    scenario: Scenario,
    camera: CameraSetting,
    cycles: int,
    instants: Sequence[int],
    white_rate: float,
    source: Source,
) -> Glass | None:
    """The run's display; None where the scenario has none. instants: cycles.

    Raises InputError where it cannot be shown: a panel of another size, no OpenGL.
    """
    section = scenario.display
    if section is None:
        return None
    panel = panel_of(section, camera, white_rate)
    clock: Clock = camera.clock
    velocity = 0.0 if section.pursuit is None else section.pursuit
    at = [clock.middle(n) for n in instants]
    observers: dict[str, Observer] = {}
    observers.update(observers_of(section, at, clock.edge(cycles), velocity))
    setting = DisplaySetting(panel, observers[section.observer], BATCH, True)
    slow = slow_motion(clock, cycles, panel.shape, setting.batch)
    shown = DisplayStage(
        setting, observers, slow, cycles,
        lambda images: _renderer(section.renderer, panel, setting.batch, images),
    )  # fmt: skip
    return Glass(section, setting, observers, velocity, slow, shown, None)
