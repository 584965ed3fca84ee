"""The display as a stage after the recorder: the stream's words go to a renderer, and observers
look at what it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block
from cosim.spikes.viform import WORD, Viform, Words
from display import AnyRenderer, DisplaySetting, Observer, Views, panel_views
from display.observe.slow_motion import Film, SlowMotion

__all__ = ["DRAW", "DisplayStage"]

DRAW = 128
"""Planes that a renderer is given at once, at most."""
State = dict[str, npt.NDArray[Any]]


class DisplayStage:
    """Shows a stream on a panel.

    setting: the panel, and how finely time is resolved. observers: by name; each makes its images.
    motion: the slow motion, None for none. cycles: of the run. renderer: makes a renderer with so
    many images; it is made here, so that what cannot be drawn is said before anything is written.
    mapped: the stream's words on the panel's pixels.

    images, emitted and film are whole after the last block. An exposure of the slow motion has an
    image of the renderer while light falls on it, which the next one has after it.
    """

    def __init__(
        self,
        setting: DisplaySetting,
        observers: Mapping[str, Observer],
        motion: SlowMotion | None,
        cycles: int,
        renderer: Callable[[int], AnyRenderer],
        mapped: Callable[[Words], Words] | None = None,
    ) -> None:
        self._batch, self._observers = setting.batch, dict(observers)
        self._panel = setting.shown
        self._cycles, self._mapped = cycles, mapped
        self.film = None if motion is None else Film(motion)
        """The slow motion."""
        self._exposures = max(
            (len(self._lit(n, min(DRAW, cycles - n))) for n in range(0, cycles, DRAW)), default=0
        )  # that light falls on at once
        self._light = sum(o.images for o in self._observers.values())
        # The image of all light; those of the slow motion follow.
        self.renderer = renderer(self._light + 1 + self._exposures)
        self._closed = False
        self._waiting: list[Words] = []
        self._first = self._planes = 0  # of what waits
        self.fired = self.spikes = 0
        """Spikes so far: those that came, and those shown, on the panel's pixels."""
        self.images: dict[str, npt.NDArray[np.float32]] = {}
        """By observer: (images, height, width), white = 1."""
        self.emitted: float | None = None
        """Light of all planes and pixels, in packets Q."""

    def step(self, given: Viform, block: Block) -> Viform:
        """Takes one block; draws when there are enough, or at the run's end."""
        words = given.words
        self.fired += int(np.bitwise_count(words).sum(dtype=np.int64))
        if self._mapped is not None:
            words = self._mapped(words)
        self._waiting.append(words)
        self._planes += block.cycles
        last = block.stop == self._cycles
        # What does not fill its last word cannot be gone on with in the next block's.
        if last or self._planes + block.cycles > DRAW or self._planes % WORD:
            self._draw()
        if last:
            self._end()
        return given

    def _draw(self) -> None:
        words = self._waiting[0] if len(self._waiting) == 1 else np.concatenate(self._waiting)
        first, planes = self._first, self._planes
        self._waiting, self._first, self._planes = [], first + planes, 0
        if self._mapped is None:
            self.spikes = self.fired
        else:
            self.spikes += int(np.bitwise_count(words).sum(dtype=np.int64))
        self.renderer.step(words, planes, self._views(first, planes))
        if self.film is not None:
            self._keep(self.film, self._first)

    def _keep(self, film: Film, plane: int) -> None:
        """Takes the exposures that no light of `plane` or a later one falls on."""
        motion = film.motion
        until = self._panel.start(plane) if plane < self._cycles else None
        while film.done < motion.count:
            over = motion.begin + (film.done + 1) * motion.exposure
            if until is not None and over > until:
                break
            dark = over <= self._panel.start(0)  # no light has fallen on it: it has no image
            image = (
                np.zeros(self._panel.shape) if dark else self.renderer.take(self._place(film.done))
            )
            film.keep(film.done, image)
            film.done += 1

    def _lit(self, first: int, planes: int) -> range:
        """Exposures of the slow motion on which light of these planes falls."""
        if self.film is None:
            return range(0)
        stop = self._panel.start(first + planes) + round(self._panel.row_delay)
        return range(*self.film.motion.touched(self._panel.start(first), stop))

    def _place(self, exposure: int) -> int:
        """The renderer's image of an exposure: another than its neighbours'."""
        return self._light + 1 + exposure % self._exposures

    def _views(self, first: int, planes: int) -> Views:
        """A row an image: those of the observers, all light, the slow motion's."""

        def seen(observer: Observer) -> Views:
            return panel_views(observer, self._panel, first, planes, self._batch)

        spans = -(-planes // self._batch)
        none = np.zeros((1, spans))
        parts = [seen(observer) for observer in self._observers.values()]
        parts.append(Views(none + 1, none, none, none, none, none))
        if self.film is not None and self._exposures:
            rows = {f.name: np.zeros((self._exposures, spans)) for f in fields(Views)}
            lit = self._lit(first, planes)
            if lit:
                views = seen(self.film.motion.camera(lit.start, lit.stop))
                at = [exposure % self._exposures for exposure in lit]
                for name, values in rows.items():
                    values[at] = getattr(views, name)
            parts.append(Views(**rows))
        return Views.joined(parts)

    def _end(self) -> None:
        """Takes every image; the renderer is done with."""
        first = 0
        for name, observer in self._observers.items():
            taken = [self.renderer.take(first + n) for n in range(observer.images)]
            self.images[name] = np.stack(taken).astype(np.float32)
            first += observer.images
        self.emitted = float(self.renderer.take(self._light).sum(dtype=np.float64))
        self.close()

    def close(self) -> None:
        """Gives the renderer back, once."""
        if not self._closed:
            self.renderer.close()
        self._closed = True

    def state(self) -> State:
        """Everything the next block depends on; after the last block, everything it made."""
        state = {"shown": np.array([self._first, self._planes, self.fired, self.spikes])}
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
        """Go on from a `state`."""
        self._first, self._planes, self.fired, self.spikes = (int(n) for n in state["shown"])
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
