"""The display in the chain of a run: panel, renderer, observers and reference displays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block
from cosim.compute.opencl import Device
from cosim.run.progress import Progress
from cosim.spikes.ancillary import Ancillary, RegisterWrite, from_arrays, to_arrays
from cosim.spikes.viform import Viform, Words
from cosim.stage import State, section
from display.chain.pursuit import Pursuit
from display.chain.tap import LightTap
from display.core import Images, LiveDisplay, short_notes
from display.observe.slow_motion import Film, SlowMotion, exposure_cycles, slow_motion
from display.observe.views import Observer, Views, panel_views
from display.panels.panel import SpikePanel, fit_words
from display.probes.metrics import Probes, kept_probes
from display.probes.setup import ProbeCamera
from display.references.stage import TRUTH, ReferenceStage
from display.render.factory import DRAW, AnyRenderer, make_renderer
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
        section.mapping(scene, panel), points,
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


class PanelStage(LiveDisplay):
    """Shows a stream on a panel.

    An exposure of the slow motion uses an image of the renderer during the exposure; later
    exposures reuse the same image.

    Args:
        setting, observers, renderer, mapping: see `LiveDisplay`.
        motion: exposures of the slow motion, None for none.
        cycles: length of the run, cycles.
        points: pixels of interest, (row, column, label).

    Attributes:
        told: what the source of the stream has said beyond its spikes so far; planes of charges
            have the points alone, (1, points).
        film: the slow motion, complete after the last block; None for none.
        fired: number of spikes in the stream so far; complete after the last block.
        packets: light of the spikes displayed so far, packets of the nominal threshold.
        images: images by observer, (images, height, width), white = 1; complete after the last
            block.
        one_thread: True: the renderer works in the thread that has created it.
        emitted: light of all planes and pixels, packets; None before the last block.
    """

    one_thread = True

    def __init__(
        self,
        setting: DisplaySetting,
        observers: Mapping[str, Observer],
        motion: SlowMotion | None,
        cycles: int,
        renderer: Callable[[int], AnyRenderer],
        mapping: Callable[[Words], Words] | None = None,
        points: Sequence[tuple[int, int, str]] = (),
    ) -> None:
        self._points, self.told = points, list[Ancillary]()
        self._panel, self._cycles = setting.simulated_panel, cycles
        self.film = None if motion is None else Film(motion)
        self._exposures = max(
            (len(self._exposed(n, min(DRAW, cycles - n))) for n in range(0, cycles, DRAW)),
            default=0,
        )  # maximum number of simultaneous exposures
        # Images of the sum of all light, and of the slow motion.
        super().__init__(setting, observers, renderer, mapping, 1 + self._exposures)
        self._closed = False
        # The words that are drawn are those of the stream: they are counted once.
        self._counts = mapping is None and not setting.panel.residues
        self.fired, self.packets = 0, 0.0
        self.images: Images = {}
        self.emitted: float | None = None

    def step(self, data: Viform, block: Block) -> Viform:
        """Takes one block; draws when there are enough planes, or at the end of the run."""
        if not self._counts:
            self.fired += int(np.bitwise_count(data.words).sum(dtype=np.int64))
        last = block.stop == self._cycles
        self._follower.stream = data.shape
        self.told += [self._at_points(each) for each in data.ancillary]
        self.push(data.words, block.cycles, last=last, ancillary=data.ancillary)
        if last:
            self.images = self.take()
            self.emitted = float(self.renderer.take(self._own).sum(dtype=np.float64))
            self.close()
        return data

    def _at_points(self, said: Ancillary) -> Ancillary:
        if isinstance(said, RegisterWrite):
            return said
        places = np.array([point[:2] for point in self._points], np.intp).reshape(-1, 2)
        return replace(said, gain=said.gain[places[:, 0], places[:, 1]][None])

    def _render(self, words: Words, first: int, planes: int) -> None:
        super()._render(words, first, planes)
        spikes = int(np.bitwise_count(words).sum(dtype=np.int64))
        self.packets += self._follower.packet * spikes
        self.fired += spikes if self._counts else 0
        if self.film is not None:
            self._finish_exposures(self.film, first + planes)

    def _finish_exposures(self, film: Film, plane: int) -> None:
        """Completes the exposures that end before the light of `plane`."""
        motion = film.motion
        until = self._panel.start(plane) if plane < self._cycles else None
        while film.done < motion.count:
            over = motion.begin + (film.done + 1) * motion.exposure
            if until is not None and over > until:
                break
            dark = over <= self._panel.start(0)  # the exposure ends before the first light
            image = (
                np.zeros(self._panel.shape) if dark else self.renderer.take(self._place(film.done))
            )
            film.keep(film.done, image)
            film.done += 1

    def _exposed(self, first: int, planes: int) -> range:
        """Exposures of the slow motion that overlap the light of these planes."""
        if self.film is None:
            return range(0)
        stop = self._panel.start(first + planes) + round(self._panel.row_delay)
        return range(*self.film.motion.touched(self._panel.start(first), stop))

    def _place(self, exposure: int) -> int:
        """Index of the renderer's image for an exposure; simultaneous exposures have different
        images."""
        return self._own + 1 + exposure % self._exposures

    def _views(self, first: int, planes: int) -> list[Views]:
        """Views of the observers, of the sum of all light, and of the slow motion."""
        spans = -(-planes // self._batch)
        none = np.zeros((1, spans))
        parts = [*super()._views(first, planes), Views(none + 1, none, none, none, none, none)]
        if self.film is not None and self._exposures:
            rows = {f.name: np.zeros((self._exposures, spans)) for f in fields(Views)}
            exposed = self._exposed(first, planes)
            if exposed:
                camera = self.film.motion.camera(exposed.start, exposed.stop)
                views = panel_views(camera, self._panel, first, planes, self._batch)
                at = [exposure % self._exposures for exposure in exposed]
                for name, values in rows.items():
                    values[at] = getattr(views, name)
            parts.append(Views(**rows))
        return parts

    def close(self) -> None:
        """Releases the renderer."""
        if not self._closed:
            self.renderer.close()
        self._closed = True

    def state(self) -> State:
        """Everything that the next block depends on; after the last block, the results."""
        state = {
            "counts": np.array([self._first, self._planes, self.fired]),
            "packets": np.array([self.packets, self._follower.packet]),
            **{f"ahead/{name}": value for name, value in to_arrays(self._ahead).items()},
            **{f"told/{name}": value for name, value in to_arrays(self.told).items()},
        }
        if self._waiting:
            state["waiting"] = np.concatenate(self._waiting)
        if self.film is not None:
            state |= {f"film/{name}": value for name, value in self.film.state().items()}
        if self.emitted is None:
            state |= {f"renderer/{name}": value for name, value in self.renderer.state().items()}
        else:
            state["emitted"] = np.array(self.emitted)
            state |= {f"image/{name}": value for name, value in self.images.items()}
        return state

    def restore(self, state: State) -> None:
        """Restores a `state`."""
        self._first, self._planes, self.fired = (int(n) for n in state["counts"])
        self.packets, self._follower.packet = (float(x) for x in state["packets"])
        self._ahead = list(from_arrays(section(state, "ahead")))
        self.told = list(from_arrays(section(state, "told")))
        self._waiting = [state["waiting"]] if "waiting" in state else []
        if self.film is not None:
            self.film.restore(section(state, "film"))
        if "emitted" in state:
            self.emitted = float(state["emitted"])
            self.images = section(state, "image")
            self.close()
        else:
            self.renderer.restore(section(state, "renderer"))
