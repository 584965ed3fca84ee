"""The panel as the last stage of a run: a renderer and the observers of its light."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block
from cosim.spikes.viform import WORD, Viform, Words
from display.observe.slow_motion import Film, SlowMotion
from display.observe.views import Observer, Views, panel_views
from display.render.factory import DRAW, AnyRenderer
from display.setting import DisplaySetting

__all__ = ["PanelStage"]

State = dict[str, npt.NDArray[Any]]


class PanelStage:
    """Shows a stream on a panel.

    An exposure of the slow motion uses an image of the renderer during the exposure; later
    exposures reuse the same image.

    Args:
        setting: the panel, its observer, and the resolution in time.
        observers: observers by name.
        motion: exposures of the slow motion, None for none.
        cycles: length of the run, cycles.
        renderer: creates a renderer for a number of images. It is called in the constructor, so
            that its errors come before any file is written.
        mapping: maps words of the stream to words of the panel; None for equal sizes.

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
        self._batch, self._observers = setting.batch, dict(observers)
        self._panel = setting.simulated_panel
        self._cycles, self._mapping = cycles, mapping
        self.film = None if motion is None else Film(motion)
        self._exposures = max(
            (len(self._exposed(n, min(DRAW, cycles - n))) for n in range(0, cycles, DRAW)),
            default=0,
        )  # maximum number of simultaneous exposures
        self._light = sum(o.images for o in self._observers.values())
        # Images of the observers, the sum of all light, and the slow motion.
        self.renderer = renderer(self._light + 1 + self._exposures)
        self._closed = False
        self._waiting: list[Words] = []  # words that are not rendered yet
        self._first = self._planes = 0  # first plane and number of planes of `_waiting`
        self.fired = self.spikes = 0
        self.images: dict[str, npt.NDArray[np.float32]] = {}
        self.emitted: float | None = None

    def step(self, data: Viform, block: Block) -> Viform:
        """Takes one block; draws when there are enough planes, or at the end of the run."""
        words = data.words
        self.fired += int(np.bitwise_count(words).sum(dtype=np.int64))
        if self._mapping is not None:
            words = self._mapping(words)
        self._waiting.append(words)
        self._planes += block.cycles
        last = block.stop == self._cycles
        # The next block cannot continue an incomplete word.
        if last or self._planes + block.cycles > DRAW or self._planes % WORD:
            self._draw()
        if last:
            self._end()
        return data

    def _draw(self) -> None:
        words = self._waiting[0] if len(self._waiting) == 1 else np.concatenate(self._waiting)
        first, planes = self._first, self._planes
        self._waiting, self._first, self._planes = [], first + planes, 0
        if self._mapping is None:
            self.spikes = self.fired
        else:
            self.spikes += int(np.bitwise_count(words).sum(dtype=np.int64))
        self.renderer.step(words, planes, self._views(first, planes))
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
        return self._light + 1 + exposure % self._exposures

    def _views(self, first: int, planes: int) -> Views:
        """The views of all images: of the observers, of the sum of all light, of the slow
        motion."""

        def views_of(observer: Observer) -> Views:
            return panel_views(observer, self._panel, first, planes, self._batch)

        spans = -(-planes // self._batch)
        none = np.zeros((1, spans))
        parts = [views_of(observer) for observer in self._observers.values()]
        parts.append(Views(none + 1, none, none, none, none, none))
        if self.film is not None and self._exposures:
            rows = {f.name: np.zeros((self._exposures, spans)) for f in fields(Views)}
            exposed = self._exposed(first, planes)
            if exposed:
                views = views_of(self.film.motion.camera(exposed.start, exposed.stop))
                at = [exposure % self._exposures for exposure in exposed]
                for name, values in rows.items():
                    values[at] = getattr(views, name)
            parts.append(Views(**rows))
        return Views.joined(parts)

    def _end(self) -> None:
        """Reads all images and releases the renderer."""
        first = 0
        for name, observer in self._observers.items():
            images = [self.renderer.take(first + n) for n in range(observer.images)]
            self.images[name] = np.stack(images).astype(np.float32)
            first += observer.images
        self.emitted = float(self.renderer.take(self._light).sum(dtype=np.float64))
        self.close()

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
            self.film.restore(_below(state, "film/"))
        if "emitted" in state:
            self.emitted = float(state["emitted"])
            self.images = _below(state, "image/")
            self.close()
        else:
            self.renderer.restore(_below(state, "renderer/"))


def _below(state: State, prefix: str) -> State:
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
