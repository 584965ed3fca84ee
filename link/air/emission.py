"""The light of each plane of a symbol, in units of a pixel that is on.

A panel that follows its drive at once shows all planes of a symbol alike. One that rises and decays
goes through `display`'s own emitter, plane by plane; within a plane its light is spread evenly.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from display import SpikePanel
from display.trial.pixels import PanelPixels

__all__ = ["Emission", "Source"]

Pixels = npt.NDArray[np.bool_]
_KEPT = 16
"""Symbols whose beginning is remembered, so that a run may go on from a checkpoint: a block's light
reaches four cycles beyond where it would go on. Each is a panel of float64."""


class Source(Protocol):
    """What the panel shows (`link.sending.Transmission`)."""

    def pixels(self, symbol: int) -> Pixels: ...
    @property
    def ticks(self) -> int: ...


class Emission:
    """planes: of the whole transmission. Symbols must be asked for in order once the emitter is
    slow; `seek` begins anew."""

    def __init__(self, source: Source, panel: SpikePanel, planes: int) -> None:
        self._source, self._panel, self._planes = source, panel, planes
        self.slow = panel.rise > 0 or panel.decay > 0
        self._next = 0
        self._level = np.zeros(panel.shape[0] * panel.shape[1]) if self.slow else np.zeros(0)
        self._before: dict[int, npt.NDArray[np.float64]] = {}

    def planes(self, symbol: int) -> list[npt.NDArray[Any]]:
        """One (height, width) of the panel for all planes of the symbol, or one for each."""
        bits = self._source.pixels(symbol)
        if not self.slow:
            return [bits]
        if symbol != self._next:
            raise ValueError(f"symbol must be {self._next}, not {symbol}: an emitter remembers")
        ticks = min(self._source.ticks, self._planes - symbol * self._source.ticks)
        pixels = PanelPixels(self._panel, bits.size)
        pixels.level[:] = self._level
        self._before[symbol] = self._level
        self._before.pop(symbol - _KEPT, None)
        word = np.where(bits.ravel(), np.uint32((1 << ticks) - 1), np.uint32(0))[None]
        light = pixels.light(word, ticks, 1)
        self._level, self._next = pixels.level, symbol + 1
        return [plane.reshape(bits.shape).astype(np.float32) for plane in light]

    def state(self, symbol: int) -> dict[str, npt.NDArray[Any]]:
        """What `planes` needs to go on from this symbol, one of the last that were asked for or the
        next."""
        if not self.slow:
            return {"symbol": np.array(symbol)}
        symbol = min(max(symbol, min(self._before, default=self._next)), self._next)
        return {"symbol": np.array(symbol), "level": self._before.get(symbol, self._level).copy()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self._next = int(state["symbol"])
        self._before.clear()
        if self.slow:
            self._level = state["level"].copy()
