"""The exact pixel, compiled by numba: one pixel at a time, the same bits as `NumpyPixels`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.cores import by_rows
from cosim.compute.philox_compiled import word_at
from cosim.compute.streams import Stream
from cosim.spikes.viform import words_for
from sensor.latched.pixel.charge import Charge, Span, transfer_spans
from sensor.latched.pixel.draws import look_up
from sensor.latched.pixel.interval import NO_TABLE
from sensor.latched.pixel.model import DEEPEST, JUMP, ExactModel, PixelState

_RULE = {"residual": 0, "hard": 1, "subtract": 2}
_STREAM = np.uint64(Stream.SHOT_NOISE)


@njit(cache=True, nogil=True)
def _threshold(table, k, pixel, seed):  # type: ignore[no-untyped-def]
    """Threshold of spike k, Q24.40."""
    return look_up(table, word_at(pixel, k, np.uint64(0), seed, _STREAM))


# Arrays are separate arguments: unpacking records takes 3 us a call (10 in place of 7).
@njit(cache=True, nogil=True)
def _expose(  # type: ignore[no-untyped-def]
    p0, p1, deficit, spikes, pixels, charge, slope, ramp, elapsed, table, noisy, q, room, reset,
    dead, seed, first, cycles, words,
):  # fmt: skip
    """Runs pixels `p0` to `p1` over a span's cycles; see `PixelState`, `Span` and `ExactModel`."""
    for p in range(p0, p1):
        d, k, pixel = deficit[p], spikes[p], np.uint64(pixels[p])
        add, step = charge[p], np.int64(0)
        if ramp:
            step = slope[p]
            add += step * elapsed
        for c in range(first, first + cycles):
            d -= add
            if d < 0:
                lost = (add >> 16) * dead
                words[c >> 5, p] |= np.uint32(1 << (c & 31))
                k += np.uint64(1)
                fresh = (_threshold(table, k, pixel, seed) if noisy else q) + lost
                d = fresh - 1 if reset == 1 else d + fresh
                if reset == 2:
                    d = max(d, DEEPEST)
                while reset == 0 and d < 0:
                    if d < -room:
                        whole = max(-d // (q + lost) - JUMP, 0)
                        d += whole * (q + lost)
                        k += np.uint64(whole)
                    k += np.uint64(1)
                    d += (_threshold(table, k, pixel, seed) if noisy else q) + lost
            add += step
        deficit[p], spikes[p] = d, k


class CompiledPixels:
    """One pixel at a time, on all cores. pixels: (n,) uint32, their numbers on the chip."""

    def __init__(self, model: ExactModel, pixels: npt.NDArray[np.uint32]) -> None:
        self._model, self._pixels = model, pixels
        self._state = model.initial(pixels)
        self._table: Charge = model.table() if model.noisy else NO_TABLE

    def expose(self, spans: Iterable[Span], cycles: int) -> npt.NDArray[np.uint32]:
        words = np.zeros((words_for(cycles), self._pixels.size), np.uint32)
        model, state = self._model, self._state
        for span in transfer_spans(spans, model.transfers) if model.transfers else spans:
            ramp = span.slope is not None
            if span.advance is not None:
                state.deficit[:] -= span.advance
            by_rows(
                _expose, self._pixels.size, state.deficit, state.spikes, self._pixels, span.charge,
                span.slope if ramp else span.charge, ramp, span.elapsed, self._table, model.noisy,
                model.q, model.room, _RULE[model.reset], model.dead, np.uint64(model.seed),
                span.first, span.cycles, words,
            )  # fmt: skip
            if span.advance is not None:
                state.deficit[:] += span.advance
        return words

    def state(self) -> PixelState:
        return PixelState(self._state.deficit.copy(), self._state.spikes.copy())

    def restore(self, state: PixelState) -> None:
        self._state = PixelState(state.deficit.copy(), state.spikes.copy())
