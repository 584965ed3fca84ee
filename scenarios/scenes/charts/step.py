"""Eight grey bars whose light steps from one level to another at one instant."""

from __future__ import annotations

import numpy as np

from cosim import Block, Light, Piece, Plane, seconds_to_ps

BARS = 8


class StepSource:
    """Bar b of 8 has the reflectance (b + 1)/8. The step may be inside a latch cycle.

    Args:
        shape: (height, width), pixels.
        illuminance: illuminance at a level of 1, lux.
        before, after: levels of the light before and after the step.
        at: instant of the step, s.
        stop: end of the run, ps.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        illuminance: float,
        before: float,
        after: float,
        at: float,
        stop: int,
    ) -> None:
        self.shape = shape
        bars = (np.arange(shape[1]) * BARS // shape[1] + 1) / BARS
        wedge = np.broadcast_to(bars.astype(np.float32), shape)
        self._levels = [np.ascontiguousarray(wedge * np.float32(x)) for x in (before, after)]
        self._at = seconds_to_ps(at)
        lux = [level * np.float32(illuminance) for level in self._levels]
        pieces = [Piece(self._at, 2**62, lux[1], lux[1])]
        if self._at > 0:
            pieces.insert(0, Piece(0, self._at, lux[0], lux[0]))
        self._light = Light(tuple(pieces))
        self.notes = [f"the light steps at {at * 1e3:g} ms, constant before and after"]
        self.degraded: list[str] = []
        if self._at >= stop:
            self.degraded.append("the run ends before the step of the light: lengthen duration")

    def step(self, data: None, block: Block) -> Light:
        return self._light

    def truth(self, ps: int) -> Plane:
        return self._levels[ps >= self._at]

    def points(self) -> list[tuple[int, int, str]]:
        height, width = self.shape
        return [
            (height // 2, (2 * b + 1) * width // (2 * BARS), f"bar {b + 1}") for b in range(BARS)
        ]
