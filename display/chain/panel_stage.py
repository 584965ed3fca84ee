"""The panel as the last stage of a run: a renderer and the observers of its light."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields

import numpy as np

from cosim import Block
from cosim.spikes.viform import Viform, Words
from cosim.stage import State, section
from display.core import Images, LiveDisplay
from display.observe.slow_motion import Film, SlowMotion
from display.observe.views import Observer, Views, panel_views
from display.render.factory import DRAW, AnyRenderer
from display.setting import DisplaySetting


class PanelStage(LiveDisplay):
    """Shows a stream on a panel.

    An exposure of the slow motion uses an image of the renderer during the exposure; later
    exposures reuse the same image.

    Args:
        setting, observers, renderer, mapping: see `LiveDisplay`.
        motion: exposures of the slow motion, None for none.
        cycles: length of the run, cycles.

    Attributes:
        film: the slow motion, complete after the last block; None for none.
        fired: number of spikes in the stream so far.
        spikes: number of spikes displayed so far.
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
    ) -> None:
        self._panel, self._cycles = setting.simulated_panel, cycles
        self.film = None if motion is None else Film(motion)
        self._exposures = max(
            (len(self._exposed(n, min(DRAW, cycles - n))) for n in range(0, cycles, DRAW)),
            default=0,
        )  # maximum number of simultaneous exposures
        # Images of the sum of all light, and of the slow motion.
        super().__init__(setting, observers, renderer, mapping, 1 + self._exposures)
        self._closed = False
        self.fired = self.spikes = 0
        self.images: Images = {}
        self.emitted: float | None = None

    def step(self, data: Viform, block: Block) -> Viform:
        """Takes one block; draws when there are enough planes, or at the end of the run."""
        self.fired += int(np.bitwise_count(data.words).sum(dtype=np.int64))
        last = block.stop == self._cycles
        self.push(data.words, block.cycles, last=last)
        if last:
            self.images = self.take()
            self.emitted = float(self.renderer.take(self._own).sum(dtype=np.float64))
            self.close()
        return data

    def _render(self, words: Words, first: int, planes: int) -> None:
        super()._render(words, first, planes)
        if self._mapping is None:
            self.spikes = self.fired
        else:
            self.spikes += int(np.bitwise_count(words).sum(dtype=np.int64))
        if self.film is not None:
            self._finish_exposures(self.film, self._first)

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
        """Those of the observers, of the sum of all light, and of the slow motion."""
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
        state = {"counts": np.array([self._first, self._planes, self.fired, self.spikes])}
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
        self._first, self._planes, self.fired, self.spikes = (int(n) for n in state["counts"])
        self._waiting = [state["waiting"]] if "waiting" in state else []
        if self.film is not None:
            self.film.restore(section(state, "film"))
        if "emitted" in state:
            self.emitted = float(state["emitted"])
            self.images = section(state, "image")
            self.close()
        else:
            self.renderer.restore(section(state, "renderer"))
