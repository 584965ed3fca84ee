"""The exact pixel in numpy: the golden model of the compiled forms."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, words_for
from sensor.latched.pixel.charge import LARGEST, ONE, Charge, Span
from sensor.latched.pixel.model import DEEPEST, JUMP, ExactModel, PixelState
from sensor.latched.pixel.thresholds import thresholds


class NumpyPixels:
    """One numpy operation a cycle over all pixels. pixels: (n,) uint32, their numbers."""

    def __init__(self, model: ExactModel, pixels: npt.NDArray[np.uint32]) -> None:
        self._model, self._pixels = model, pixels
        self._state = model.initial(pixels)

    def _refill(self, due: npt.NDArray[np.bool_], charge: Charge) -> None:
        """Starts the next interval of the pixels that are due. charge: of this cycle, all
        pixels."""
        state, model = self._state, self._model
        state.spikes[due] += np.uint64(1)
        threshold: Charge | int = model.q
        if model.noisy:
            threshold = thresholds(model.table(), state.spikes[due], self._pixels[due], model.seed)
        lost = (charge[due] >> 16) * model.dead
        if model.reset == "hard":
            state.deficit[due] = threshold - 1 + lost
        else:
            state.deficit[due] += threshold + lost

    def _cycle(self, charge: Charge) -> npt.NDArray[np.bool_]:
        """Runs one cycle; returns which pixels reach a threshold in it."""
        state, model = self._state, self._model
        state.deficit -= charge
        fired = state.deficit < 0
        self._refill(fired, charge)
        if model.reset == "subtract":
            np.maximum(state.deficit, DEEPEST, out=state.deficit)
            return fired
        while (state.deficit < 0).any():
            deep = state.deficit < -model.room
            one = model.q + (charge[deep] >> 16) * model.dead
            whole = np.maximum(-state.deficit[deep] // one - JUMP, 0)
            state.deficit[deep] += whole * one
            state.spikes[deep] += whole.astype(np.uint64)
            self._refill(state.deficit < 0, charge)
        return fired

    def expose(self, spans: Iterable[Span], cycles: int) -> npt.NDArray[np.uint32]:
        words = np.zeros((words_for(cycles), self._pixels.size), np.uint32)
        for span in spans:
            for i in range(span.cycles):
                charge = span.charge
                if span.slope is not None:
                    charge = charge + span.slope * (span.elapsed + i)
                for transfer in self._model.transfers:
                    charge = np.minimum(transfer.charge(charge), LARGEST * ONE)
                c = span.first + i
                early = 0 if span.advance is None else span.advance
                self._state.deficit -= early
                words[c // WORD] |= self._cycle(charge).astype(np.uint32) << np.uint32(c % WORD)
                self._state.deficit += early
        return words

    def state(self) -> PixelState:
        return PixelState(self._state.deficit.copy(), self._state.spikes.copy())

    def restore(self, state: PixelState) -> None:
        self._state = PixelState(state.deficit.copy(), state.spikes.copy())
