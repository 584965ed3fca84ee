"""The display in the chain of a run: panel, renderer, observers and reference displays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.run.progress import Progress
from display.chain.panel_stage import PanelStage
from display.chain.pursuit import Pursuit
from display.chain.tap import LightTap
from display.core import short_notes
from display.observe.slow_motion import SlowMotion, exposure_cycles, slow_motion
from display.observe.views import Observer
from display.panels.fit import fit_words
from display.panels.panel import SpikePanel
from display.probes.camera import ProbeCamera
from display.probes.metrics import Probes, kept_probes
from display.references.stage import TRUTH, ReferenceStage
from display.render.factory import make_renderer
from display.section import DisplaySection
from display.setting import DisplaySetting

SPIKE = "spike"
"""Name of the spike-continuous display among the displays."""


@dataclass(frozen=True, eq=False)
class DisplayChain:
    """The stages of the display in a run.

    Attributes:
        section: the section [display] of the scenario.
        setting: the panel, its observer, and the resolution in time.
        observers: observers by name, in pixels of the scene.
        pursuit: motion that the pursuing eye follows.
        motion: exposures of the slow motion.
        points: pixels of interest, (row, column, label); `tap` records their light.
        panel_stage: stage that renders the stream.
        references: stage of the reference displays and the true light, after the scene; None
            without a scene.
        tap: stage that records the light of `points`; None without a scene.
        notes: notes for the user before the run.
    """

    section: DisplaySection
    setting: DisplaySetting
    observers: dict[str, Observer]
    pursuit: Pursuit
    motion: SlowMotion
    points: list[tuple[int, int, str]]
    panel_stage: PanelStage
    references: ReferenceStage | None
    tap: LightTap | None
    notes: list[str]

    @property
    def panel(self) -> SpikePanel:
        return self.setting.panel

    def stages(self, stages: dict[str, Any]) -> dict[str, Any]:
        """The stages of a run with those of the display: references after the scene, panel at the
        end."""
        out: dict[str, Any] = {}
        for name, stage in stages.items():
            out[name] = stage
            if name == "scene" and self.references is not None:
                out |= {"tap": self.tap, "references": self.references}
        return out | {"display": self.panel_stage}

    def images(self) -> dict[str, dict[str, npt.NDArray[np.float32]]]:
        """Images by display and observer, (images, height, width), white = 1; valid after the last
        block. Without a scene, those of the spike display alone."""
        if self.references is None:
            return {SPIKE: self.panel_stage.images}
        images = {
            name: {observer: self._on_panel(views) for observer, views in by_observer.items()}
            for name, by_observer in self.references.images().items()
        }
        return {TRUTH: images.pop(TRUTH), SPIKE: self.panel_stage.images} | images

    def _on_panel(self, images: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Images in pixels of the scene, mapped to pixels of the panel like the words of the
        stream."""
        scene, panel = images.shape[1:], self.panel.shape
        if scene == panel:
            return images
        fitted = fit_words(self.section.fit, scene, panel)(images.view(np.uint32))
        return fitted.view(np.float32)

    def frames(self) -> dict[str, npt.NDArray[np.uint8]]:
        """The slow motion by display; valid after the last block."""
        films = {} if self.references is None else dict(self.references.films)
        if self.panel_stage.film is not None:
            truth = {TRUTH: films.pop(TRUTH)} if TRUTH in films else {}
            films = truth | {SPIKE: self.panel_stage.film} | films
        return {name: film.frames for name, film in films.items()}

    def identity(self) -> str:
        """Text of the properties on which a checkpoint of the display depends, beyond the
        scenario."""
        return f"{self.panel_stage.renderer.name} {self.setting}"

    def probes(self, camera: ProbeCamera, progress: Progress, pst_lm: bool = True) -> Probes:
        """Latency, blur and flicker of all displays, with this camera in front of the panel; PstLM,
        which needs a minute of light, if wanted."""

        def told(done: int, total: int) -> None:
            progress.tell(f"probes of blur, flicker and delay: {done} of {total}")

        return kept_probes(
            camera, self.panel, self.section.reference_panels(), camera.seed,
            per_degree=self.section.distance, pst_lm=pst_lm, told=told,
        )  # fmt: skip

    def close(self) -> None:
        """Releases the renderer."""
        self.panel_stage.close()


def make_display_chain(
    section: DisplaySection,
    scene: tuple[int, int],
    white: float | None,
    cycles: int,
    instants: Sequence[int],
    planned: DisplaySetting,
    pursuit: Pursuit,
    points: list[tuple[int, int, str]],
    device: Device | None = None,
) -> DisplayChain:
    """The display of a run.

    Args:
        section: the section [display] of the scenario.
        scene: (height, width) of the scene and of the stream, pixels.
        white: illuminance of the scene's white, lux; None for a stream without a scene, which has
            neither true light nor reference displays.
        cycles: length of the run, cycles.
        instants: cycles of the images.
        planned: the simulated display.
        pursuit: motion that the pursuing eye follows, in pixels of the scene.
        points: pixels of interest, (row, column, label).
        device: OpenCL device of the renderer, None for the default one.

    Raises:
        InputError: the display cannot be rendered (no OpenGL, or too little memory).
    """
    clock, panel = planned.panel.clock, planned.panel
    # Both eyes, and the observer whose radiance the error refers to.
    names = "eye", "pursuit", section.observer
    velocity = section.on_panel(pursuit.velocity, scene, panel)
    on_scene, on_panel = (
        section.seen_by(names, clock, instants, cycles, speed)
        for speed in (pursuit.velocity, velocity)
    )
    motion, panel_motion = (slow_motion(clock, cycles, shape) for shape in (scene, panel.shape))
    setting = planned.with_spans(velocity, exposure_cycles(cycles))
    panel_stage = PanelStage(
        setting, on_panel, panel_motion, cycles,
        lambda images: make_renderer(
            section.renderer, setting.panel, setting.batch, images, device=device
        ),
        section.mapping(scene, panel),
    )  # fmt: skip
    references, tap = None, None
    if white is not None:
        panels = section.reference_panels()
        references = ReferenceStage(panels, on_scene, scene, white, clock, cycles, motion)
        tap = LightTap([(row, column) for row, column, _ in points], clock, white)
    notes = [pursuit.note, *short_notes(panel.luminance, cycles / clock.hz)]
    return DisplayChain(
        section, setting, on_scene, pursuit, motion, points, panel_stage, references, tap, notes
    )
