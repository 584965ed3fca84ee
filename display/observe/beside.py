"""The panels beside the spike display and the light itself, as a stage between scene and lens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, Light
from display import (
    FramePanel,
    FrameShow,
    Observer,
    Onlooker,
    Projector,
    ProjectorShow,
    TruthShow,
)
from display.observe.slow_motion import Film, SlowMotion

__all__ = ["LONGEST", "TRUTH", "BesideStage"]

TRUTH = "truth"
"""Name of the light itself among the panels."""
LONGEST = 16
"""Cycles of light at most that are weighted by one mean."""
Images = npt.NDArray[np.float32]


class BesideStage:
    """Shows the scene's light on panels to observers, and passes it on as it is.

    panels: as `showing.beside_of` gives them; twice the same is once. observers: by name, as
    `showing.observers_of`. shape: of the light. white: the scene's illuminance, of which
    reflectance 1 is white. clock, cycles: of the run. motion: the slow motion that is filmed of
    each, None for none.
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
        self._lookers = {
            name: {who: Onlooker(observer, shape) for who, observer in observers.items()}
            for name in self._shows
        }
        self.films = {name: Film(motion) for name in self._shows} if motion is not None else {}
        """By panel, and of the truth: its slow motion."""

    def step(self, light: Light, block: Block) -> Light:
        """Only the block's own time is looked at; the light may reach further."""
        until = self._clock.edge(block.stop)
        for name, show in self._shows.items():
            film = self.films.get(name)
            for lit in show.step(light, until):
                for looker in self._lookers[name].values():
                    looker.add(lit)
                if film is not None:
                    film.add(lit)
            if film is not None:
                film.close(until)
        return light

    def images(self) -> dict[str, dict[str, Images]]:
        """By panel (and "truth") and observer, (images, H, W) float32, white = 1."""
        return {
            name: {who: looker.images for who, looker in lookers.items()}
            for name, lookers in self._lookers.items()
        }

    def _parts(self) -> dict[str, Any]:
        """Everything with a state, by its key."""
        parts: dict[str, Any] = {f"{name}/show": show for name, show in self._shows.items()}
        for name, lookers in self._lookers.items():
            parts |= {f"{name}/look/{who}": looker for who, looker in lookers.items()}
        return parts | {f"{name}/film": film for name, film in self.films.items()}

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next block depends on."""
        return {
            f"{key}/{name}": value
            for key, part in self._parts().items()
            for name, value in part.state().items()
        }

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        for key, part in self._parts().items():
            inside = {
                name.removeprefix(f"{key}/"): value
                for name, value in state.items()
                if name.startswith(f"{key}/")
            }
            part.restore(inside)
