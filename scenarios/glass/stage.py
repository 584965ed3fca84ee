"""The display as a stage after the recorder: the stream's words go to a renderer, and observers
look at what it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from cosim import Block
from cosim.viform import Viform, Words
from display import Observer, Views, panel_views
from display.setting import DisplaySetting
from scenarios.glass.slow import Slots, SlowMotion, small

__all__ = ["DRAW", "DisplayStage"]

DRAW = 128
"""Planes that a renderer is given at once, at most."""
State = dict[str, npt.NDArray[Any]]
Values = npt.NDArray[np.float64]


class Renderer(Protocol):
    """What draws a panel (see `display.PlainRenderer`)."""

    @property
    def name(self) -> str: ...
    def step(self, words: Words, cycles: int, views: Views | None) -> None: ...
    def take(self, image: int) -> npt.NDArray[np.floating[Any]]: ...
    def state(self) -> State: ...
    def restore(self, state: State) -> None: ...
    def close(self) -> None: ...


class DisplayStage:
    """Shows a stream on a panel.

    setting: the panel, and how finely time is resolved. observers: by name; each makes its images.
    slow: the slow motion, None for none. cycles: of the run. renderer: makes a renderer with so
    many images; it is made here, so that what cannot be drawn is said before anything is written.
    mapped: the stream's words on the panel's pixels.

    images, light and frames are whole after the last block.
    """

    def __init__(
        self,
        setting: DisplaySetting,
        observers: Mapping[str, Observer],
        slow: SlowMotion | None,
        cycles: int,
        renderer: Callable[[int], Renderer],
        mapped: Callable[[Words], Words] | None = None,
    ) -> None:
        self._batch, self._observers, self._slow = setting.batch, dict(observers), slow
        self._panel = setting.panel if setting.row_timing else replace(setting.panel, row_scan=0.0)
        self._cycles, self._mapped = cycles, mapped
        self._slots = None if slow is None else Slots(slow, self._panel, cycles, DRAW)
        self._light = sum(o.images for o in self._observers.values())  # slot of all light
        self._slot = self._light + 1  # the first of the slow motion
        count = self._slot + (0 if self._slots is None else self._slots.count)
        self.renderer = renderer(count)
        self._waiting: list[Words] = []
        self._first = self._planes = 0  # of what waits
        self.fired = self.spikes = 0
        """Spikes so far: those that came, and those shown, on the panel's pixels."""
        self.images: dict[str, npt.NDArray[np.float32]] = {}
        """By observer: (images, height, width), white = 1."""
        self.emitted: float | None = None
        """Light of all planes and pixels, in packets Q."""
        tile = (0, 0) if slow is None else slow.tile
        self.frames = np.zeros((0 if slow is None else slow.frames, *tile), np.uint8)
        """The slow motion, through the sRGB curve."""

    def step(self, given: Viform, block: Block) -> Viform:
        """Takes one block; draws when there are enough, or at the run's end."""
        words = given.words
        self.fired += int(np.bitwise_count(words).sum(dtype=np.int64))
        if self._mapped is not None:
            words = self._mapped(words)
        self._waiting.append(words)
        self._planes += block.cycles
        last = block.stop == self._cycles
        # A block that does not fill its last word cannot be gone on with in the next one.
        if last or self._planes + block.cycles > DRAW or self._planes % 32:
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
        if self._slots is not None and self._slow is not None:
            for slot, frame in self._slots.finished(first + planes):
                self.frames[frame] = small(self.renderer.take(self._slot + slot), self._slow.tile)

    def _views(self, first: int, planes: int) -> Views:
        """A row an image: those of the observers, all light, the slots of the slow motion."""

        def seen(observer: Observer) -> Views:
            return panel_views(observer, self._panel, first, planes, self._batch)

        spans = -(-planes // self._batch)
        none = np.zeros((1, spans))
        parts = [seen(observer) for observer in self._observers.values()]
        parts.append(Views(none + 1, none, none, none, none, none))
        if self._slots is not None and self._slow is not None and self._slots.count:
            slots = {
                name: np.zeros((self._slots.count, spans))
                for name in ("weight", "slope", "dy", "dx", "dy_slope", "dx_slope")
            }
            held = self._slots.begin(first, planes)
            if held:
                views = seen(self._slow.one([frame for _, frame in held]))
                for name, values in slots.items():
                    values[[slot for slot, _ in held]] = getattr(views, name)
            parts.append(Views(**slots))
        return Views.joined(parts)

    def _end(self) -> None:
        """Takes every image; the renderer is done with."""
        first = 0
        for name, observer in self._observers.items():
            taken = [self.renderer.take(first + n) for n in range(observer.images)]
            self.images[name] = np.stack(taken).astype(np.float32)
            first += observer.images
        self.emitted = float(self.renderer.take(self._light).sum(dtype=np.float64))
        self.renderer.close()

    def state(self) -> State:
        """Everything the next block depends on; after the last block, everything it made."""
        state: State = {
            "shown": np.array([self._first, self._planes, self.fired, self.spikes]),
            "frames": self.frames,
        }
        if self._waiting:
            state["waiting"] = np.concatenate(self._waiting)
        if self._slots is not None:
            state["held"] = self._slots.held.copy()
        if self.emitted is None:
            state |= {f"renderer/{name}": value for name, value in self.renderer.state().items()}
        else:
            state["emitted"] = np.array(self.emitted)
            state |= {f"image/{name}": value for name, value in self.images.items()}
        return state

    def restore(self, state: State) -> None:
        """Go on from a `state`."""
        self._first, self._planes, self.fired, self.spikes = (int(n) for n in state["shown"])
        self.frames = state["frames"]
        self._waiting = [state["waiting"]] if "waiting" in state else []
        if self._slots is not None:
            self._slots.held = state["held"].copy()
        if "emitted" in state:
            self.emitted = float(state["emitted"])
            self.images = _below(state, "image/")
        else:
            self.renderer.restore(_below(state, "renderer/"))


def _below(state: State, prefix: str) -> State:
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
