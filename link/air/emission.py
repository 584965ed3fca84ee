"""The light of each plane of a symbol, relative to an ON pixel.

A panel that follows its drive without delay shows all planes of a symbol alike. For one with rise
and decay times, `display`'s emitter model computes each plane; within a plane its light is spread
evenly.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from display import SpikePanel
from display.plan.pixels import PanelPixels

Pixels = npt.NDArray[np.bool_]
_REMEMBERED = 16
"""Number of symbols whose initial state is stored, so that a run can continue from a checkpoint: a
block's light reaches four cycles beyond the next block's begin. Each state is a float64 for each
panel pixel."""


class Source(Protocol):
    """The symbols that the panel shows (`link.sending.Transmission`).

    Attributes:
        ticks: planes of a symbol.
    """

    def pixels(self, symbol: int) -> Pixels: ...
    @property
    def ticks(self) -> int: ...


class Emission:
    """Light of the panel, symbol by symbol.

    If the emitter has a memory, symbols must be requested in order; `restore` continues from a
    checkpoint.

    Args:
        source: the symbols.
        panel: the panel.
        planes: planes of the whole transmission.
    """

    def __init__(self, source: Source, panel: SpikePanel, planes: int) -> None:
        self._source, self._panel, self._planes = source, panel, planes
        self.slow = panel.rise > 0 or panel.decay > 0
        self._next = 0
        self._level = np.zeros(panel.shape[0] * panel.shape[1]) if self.slow else np.zeros(0)
        self._before: dict[int, npt.NDArray[np.float64]] = {}

    def planes(self, symbol: int) -> list[npt.NDArray[Any]]:
        """One plane (height, width) for the whole symbol, or one for each of its planes."""
        bits = self._source.pixels(symbol)
        if not self.slow:
            return [bits]
        if symbol != self._next:
            raise ValueError(f"symbol must be {self._next}, not {symbol}: an emitter remembers")
        ticks = min(self._source.ticks, self._planes - symbol * self._source.ticks)
        pixels = PanelPixels(self._panel, bits.size)
        pixels.level[:] = self._level
        self._before[symbol] = self._level
        self._before.pop(symbol - _REMEMBERED, None)
        word = np.where(bits.ravel(), np.uint32((1 << ticks) - 1), np.uint32(0))[None]
        light = pixels.light(word, ticks, 1)
        self._level, self._next = pixels.level, symbol + 1
        return [plane.reshape(bits.shape).astype(np.float32) for plane in light]

    def state(self, symbol: int) -> dict[str, npt.NDArray[Any]]:
        """What `planes` needs to continue from a symbol: the next one, or one of the last ones."""
        if not self.slow:
            return {"symbol": np.array(symbol)}
        symbol = min(max(symbol, min(self._before, default=self._next)), self._next)
        return {"symbol": np.array(symbol), "level": self._before.get(symbol, self._level).copy()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._next = int(state["symbol"])
        self._before.clear()
        if self.slow:
            self._level = state["level"].copy()
