"""The stage of the reference displays and of the true light, between scene and lens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, Light
from display.observe.integration import ObserverImages
from display.observe.slow_motion import Film, SlowMotion
from display.observe.views import Observer
from display.panels.panel import FramePanel, Projector
from display.references.frames import FrameShow
from display.references.projector import ProjectorShow
from display.references.truth import TruthShow

__all__ = ["LONGEST", "TRUTH", "ReferenceStage"]

TRUTH = "truth"
"""Name of the true light among the displays."""
LONGEST = 16
"""Maximum number of cycles of light with one mean weight."""
Images = npt.NDArray[np.float32]


class ReferenceStage:
    """Shows the light of the scene on reference panels to observers, and passes it on unchanged.

    Args:
        panels: reference panels; equal panels count once.
        observers: observers by name.
        shape: (height, width) of the light, pixels.
        white: illuminance at which reflectance 1 is white, lux.
        clock, cycles: clock and length of the run.
        motion: exposures of the slow motion of each display, None for none.

    Attributes:
        films: slow motion by panel, and of the true light.
    """

    def __init__(
        self,
        panels: Sequence[FramePanel | Projector],
        observers: Mapping[str, Observer],
        shape: tuple[int, int],
        white: float,
        clock: Clock,
        cycles: int,
        motion: SlowMotion | None = None,
    ) -> None:
        self._clock, end = clock, clock.edge(cycles)
        self._shows: dict[str, TruthShow | FrameShow | ProjectorShow] = {
            TRUTH: TruthShow(white, clock.edge(LONGEST), end)
        }
        for panel in panels:
            self._shows[panel.name] = (
                FrameShow(panel, shape, white)
                if isinstance(panel, FramePanel)
                else ProjectorShow(panel, shape, white)
            )
        self._observers = dict(observers)
        self._images = {
            name: ObserverImages(list(observers.values()), shape) for name in self._shows
        }
        self.films = {name: Film(motion) for name in self._shows} if motion is not None else {}

    def step(self, light: Light, block: Block) -> Light:
        """Shows the light of the block; `light` may extend beyond its end."""
        until = self._clock.edge(block.stop)
        for name, show in self._shows.items():
            film = self.films.get(name)
            for emitted in show.step(light, until):
                self._images[name].add(emitted)
                if film is not None:
                    film.add(emitted)
            if film is not None:
                film.close(until)
        return light

    def images(self) -> dict[str, dict[str, Images]]:
        """Images by panel (and "truth") and observer, (images, H, W) float32, white = 1."""
        out: dict[str, dict[str, Images]] = {}
        for name, seen in self._images.items():
            images, first = seen.images, 0
            out[name] = {}
            for who, observer in self._observers.items():
                out[name][who] = images[first : first + observer.images]
                first += observer.images
        return out

    def _parts(self) -> dict[str, Any]:
        """All objects with a state, by their keys."""
        parts: dict[str, Any] = {f"{name}/show": show for name, show in self._shows.items()}
        parts |= {f"{name}/images": images for name, images in self._images.items()}
        return parts | {f"{name}/film": film for name, film in self.films.items()}

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next block depends on."""
        return {
            f"{key}/{name}": value
            for key, part in self._parts().items()
            for name, value in part.state().items()
        }

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        for key, part in self._parts().items():
            inside = {
                name.removeprefix(f"{key}/"): value
                for name, value in state.items()
                if name.startswith(f"{key}/")
            }
            part.restore(inside)
