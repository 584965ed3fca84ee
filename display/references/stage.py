"""The stage of the reference displays and of the true light, between scene and lens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, Light, Piece, Plane
from display.observe.integration import ObserverImages
from display.observe.slow_motion import Film, SlowMotion
from display.observe.views import Observer
from display.panels.panel import FramePanel, Projector
from display.references.displays import FrameShow, ProjectorShow, TruthShow

TRUTH = "truth"
"""Name of the true light among the displays."""
LONGEST = 16
"""Maximum number of cycles of light with one mean weight."""
TOGETHER, PIECES = 256, 32
"""Numbers of cycles, and of pieces of light, from which on they are shown: each time, all images
are read and written, which takes as long as the arithmetic for 64 cycles."""
Images = npt.NDArray[np.float32]


def _joined(before: Piece, piece: Piece) -> Piece:
    """`piece`, beginning with the plane in which `before` ends if it begins with an equal one:
    after an interruption, the scene has drawn it again."""
    if piece.first is before.last or not np.array_equal(piece.first, before.last):
        return piece
    return replace(piece, first=before.last, last=before.last if piece.constant else piece.last)


class ReferenceStage:
    """Shows the light of the scene on reference panels to observers, and passes it on unchanged.

    Light waits until there is enough of it to be shown together, or the run ends.

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
        self._clock, self._cycles, end = clock, cycles, clock.edge(cycles)
        self._waiting: list[Piece] = []
        self._shown = self._until = 0  # cycles up to which light is shown, and waits
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
        """Takes the light of the block; `light` may extend beyond its end."""
        for piece in light.pieces:
            if not self._waiting:
                self._waiting.append(piece)
            elif piece.stop > self._waiting[-1].stop:
                self._waiting.append(_joined(self._waiting[-1], piece))
        self._until = block.stop
        enough = len(self._waiting) >= PIECES or self._until - self._shown >= TOGETHER
        if enough or self._until == self._cycles:
            self._show()
        return light

    def _show(self) -> None:
        """Shows the light that waits."""
        if self._shown == self._until:
            return
        light, until = Light(tuple(self._waiting)), self._clock.edge(self._until)
        for name, show in self._shows.items():
            film = self.films.get(name)
            for emitted in show.step(light, until):
                self._images[name].add(emitted)
                if film is not None:
                    film.add(emitted)
            if film is not None:
                film.close(until)
        self._waiting = [piece for piece in self._waiting if piece.stop > until]
        self._shown = self._until

    def images(self) -> dict[str, dict[str, Images]]:
        """Images by panel (and "truth") and observer, (images, H, W) float32, white = 1."""
        self._show()
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
        return self._light_state() | {
            f"{key}/{name}": value
            for key, part in self._parts().items()
            for name, value in part.state().items()
        }

    def _light_state(self) -> dict[str, npt.NDArray[Any]]:
        """The light that waits: its planes, each one once, and for each piece its start, stop, ps,
        and the numbers of its first and last plane."""
        planes: dict[int, Plane] = {
            id(plane): plane for piece in self._waiting for plane in (piece.first, piece.last)
        }
        number = {key: n for n, key in enumerate(planes)}
        pieces = [(p.start, p.stop, number[id(p.first)], number[id(p.last)]) for p in self._waiting]
        return {
            "light/planes": np.array(list(planes.values()), np.float32),
            "light/pieces": np.array(pieces, np.int64).reshape(-1, 4),
            "light/cycles": np.array([self._shown, self._until]),
        }

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        planes = list(state["light/planes"])
        self._waiting = [
            Piece(int(start), int(stop), planes[first], planes[last])
            for start, stop, first, last in state["light/pieces"]
        ]
        self._shown, self._until = (int(n) for n in state["light/cycles"])
        for key, part in self._parts().items():
            inside = {
                name.removeprefix(f"{key}/"): value
                for name, value in state.items()
                if name.startswith(f"{key}/")
            }
            part.restore(inside)
