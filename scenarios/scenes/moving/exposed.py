"""A scene whose mean over an exposure is in closed form, and the light that it gives a camera."""

from __future__ import annotations

import math
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim import PS, Block, Clock, Light, Piece

MOTION: Final = 0.25
"""Longest motion within a piece of light, pixels, if a piece is longer than a cycle."""


class ExposedScene(Protocol):
    """A moving scene.

    Attributes:
        shape: (rows, columns).
        speed: highest speed of the content, pixels/s.
    """

    @property
    def shape(self) -> tuple[int, int]: ...

    @property
    def speed(self) -> float: ...

    def mean(self, start: float, stop: float) -> npt.NDArray[np.float64]:
        """Mean reflectance between two instants, s, (H, W) in [0, 1]."""
        ...


class ExposedSource:
    """The light of such a scene on a clock. Its integral over each piece is exact. A piece is a
    whole number of cycles, in which the content moves by at most MOTION pixels, or one cycle; so
    the charge of each latch cycle of a faster scene is exact, at any speed.

    Args:
        scene: the scene.
        illuminance: illuminance of reflectance 1 on the pixels, lux.
        clock: latch clock.
        longest: cycles of the longest piece.
    """

    def __init__(
        self, scene: ExposedScene, illuminance: float, clock: Clock, longest: int = 64
    ) -> None:
        self._scene, self._lux, self._clock = scene, illuminance, clock
        calm = MOTION * clock.hz / scene.speed if scene.speed else math.inf
        self.every = max(1, math.floor(min(calm, longest)))
        self._pieces: dict[int, Piece] = {}

    def _piece(self, cycle: int) -> Piece:
        if cycle not in self._pieces:
            start, stop = self._clock.edge(cycle), self._clock.edge(cycle + self.every)
            plane = (self._scene.mean(start / PS, stop / PS) * self._lux).astype(np.float32)
            self._pieces[cycle] = Piece(start, stop, plane, plane)
        return self._pieces[cycle]

    def step(self, data: None, block: Block) -> Light:
        first = block.start // self.every * self.every
        self._pieces = {c: p for c, p in self._pieces.items() if c >= first}
        return Light(tuple(self._piece(c) for c in range(first, block.stop, self.every)))
