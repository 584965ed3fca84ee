"""Frame panels: holds, strobes and slow pixels, fed the true light."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS, Light, Plane, seconds_to_ps
from display.observe.integration import Gain, LightPlanes, Span, Values
from display.panels.panel import FramePanel

__all__ = ["FrameShow"]

Instants = npt.NDArray[np.int64]
PARTS, MOST = 16, 1024
"""Parts of a time constant for which the light of a slow pixel is integrated, and of a frame at
most: the light of a faster pixel in a part is still its true mean."""


def _approach(begin: int, constant: float) -> Gain:
    """exp(-(t - begin) / constant) as a mean over [start, stop): the closed form."""

    def mean(start: Instants, stop: Instants) -> Values:
        a, b = (np.asarray(t - begin, np.float64) / (constant * PS) for t in (start, stop))
        return np.exp(-a) * -np.expm1(a - b) / (b - a)

    return mean


def _times(gain: Gain | None, factor: float) -> Gain | None:
    if factor == 1:
        return gain

    def mean(start: Instants, stop: Instants) -> Values:
        return factor * (np.ones(len(start)) if gain is None else gain(start, stop))

    return mean


class FrameShow:
    """Light of a frame panel that is fed the true light, frame after frame.

    Before the first frame the panel is dark. With `response` the pixel's level approaches the
    frame's as y' = (x - y) / response all the time, in closed form; a strobe shows that level in
    the first `persistence` of each frame. State: number of the next frame, and level at its start.

    Args:
        panel: the frame panel.
        shape: (height, width).
        white: light that is shown as 1, in the unit of the light; brighter light is clipped.
    """

    def __init__(self, panel: FramePanel, shape: tuple[int, int], white: float) -> None:
        self.panel = panel
        self._white = np.float32(white)
        self._late = seconds_to_ps(panel.latency)
        self._next = 0
        self._level = np.zeros(shape, np.float32)

    def step(self, light: Light, until: int) -> Iterator[LightPlanes]:
        """What the light from where the last step ended to `until` (ps) makes shine; a frame's
        light reaches beyond."""
        while self.panel.rate.edge(self._next) < until:
            values = light.at(self.panel.rate.edge(self._next))
            yield self._frame(np.clip(values / self._white, 0, 1, dtype=np.float32))
            self._next += 1

    def _frame(self, level: Plane) -> LightPlanes:
        panel = self.panel
        start = panel.rate.edge(self._next) + self._late
        stop = panel.rate.edge(self._next + 1) + self._late
        dark = start + max(round((stop - start) * panel.persistence), 1)
        bright = (stop - start) / (dark - start)
        spans = [Span(0, start, dark, _times(None, bright))]
        if panel.response == 0:
            return LightPlanes(level[None], spans)
        behind = self._level - level
        parts = min(math.ceil((dark - start) / (panel.response * PS) * PARTS), MOST)
        spans.append(Span(1, start, dark, _times(_approach(start, panel.response), bright), parts))
        left = np.float32(math.exp(-(stop - start) / (panel.response * PS)))
        self._level = level + behind * left
        return LightPlanes(np.stack([level, behind]), spans)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next step depends on."""
        state = {"next": np.array(self._next)}
        return state | ({"level": self._level.copy()} if self.panel.response else {})

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self._next = int(state["next"])
        if self.panel.response:
            self._level = np.ascontiguousarray(state["level"], np.float32)
