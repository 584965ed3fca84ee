"""Frame panels that show the true light: sample-and-hold, strobe, and slow pixels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS, Light, Plane, seconds_to_ps
from display.observe.integration import Gain, LightPlanes, Span, Values
from display.panels.panel import FramePanel

Instants = npt.NDArray[np.int64]
PARTS, MOST = 16, 1024
"""Number of integration intervals in a time constant of a slow pixel, and maximum number in a
frame. Beyond the maximum, the light in an interval is still its true mean."""


def _approach(begin: int, constant: float) -> Gain:
    """The mean of exp(-(t - begin) / constant) over [start, stop), in closed form; `begin` in ps,
    `constant` in s."""

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
    """The light of a frame panel that shows the true light.

    The panel is dark before the first frame. With `response`, the level of a pixel follows the
    frame as y' = (x - y) / response, in closed form; a strobe shows this level in the first
    `persistence` of each frame. State: number of the next frame, and level at its start.

    Args:
        panel: the frame panel.
        shape: (height, width), pixels.
        white: light that the panel shows as 1, in the unit of the light; brighter light is clipped.
    """

    def __init__(self, panel: FramePanel, shape: tuple[int, int], white: float) -> None:
        self.panel = panel
        self._white = np.float32(white)
        self._delay = seconds_to_ps(panel.latency)
        self._next = 0
        self._level = np.zeros(shape, np.float32)

    def step(self, light: Light, until: int) -> Iterator[LightPlanes]:
        """Yields the emitted light of the frames that start before `until`, ps, after those of the
        last step. The light of a frame may extend beyond `until`."""
        while self.panel.rate.edge(self._next) < until:
            values = light.at(self.panel.rate.edge(self._next))
            yield self._frame(np.clip(values / self._white, 0, 1, dtype=np.float32))
            self._next += 1

    def _frame(self, level: Plane) -> LightPlanes:
        panel = self.panel
        start = panel.rate.edge(self._next) + self._delay
        stop = panel.rate.edge(self._next + 1) + self._delay
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
        """Everything that the next step depends on."""
        state = {"next": np.array(self._next)}
        return state | ({"level": self._level.copy()} if self.panel.response else {})

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self._next = int(state["next"])
        if self.panel.response:
            self._level = np.ascontiguousarray(state["level"], np.float32)
