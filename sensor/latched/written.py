"""Pixels of any tier whose registers are written while they run; see `writes`.

The run is cut at the writes. At a write of the threshold, the pixels of the next level take over
the charge and the interval of those before. Rows outside the window run on unseen and are reset
when they come back, so a run that only masks costs no more than one without writes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol, Self

import numpy as np
import numpy.typing as npt

from cosim.light.light import Light
from cosim.spikes.viform import WORD, words_for
from sensor.latched.writes import Phase

Words = npt.NDArray[np.uint32]
Mask = npt.NDArray[np.bool_]
_INDEX: Final = 40
"""A row that comes back at write n starts interval n x 2^40 of its pixels, which no run reaches by
counting. So its draws do not depend on spikes that nobody has seen."""
_PHASE: Final = "written"


class RewrittenPixels(Protocol):
    """Pixels of one tier and one threshold that can take over from others."""

    def expose(self, light: Light, start: int, cycles: int) -> Words: ...
    def fraction(self) -> npt.NDArray[np.float64]: ...
    def state(self) -> dict[str, npt.NDArray[Any]]: ...
    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None: ...

    def take_over(self, before: Self, cycle: int, fresh: Mask, interval: int) -> Mask | None:
        """Continues the pixels of another threshold.

        Args:
            before: the pixels up to this cycle.
            cycle: first cycle for which the threshold of these pixels holds.
            fresh: (n,) pixels that start without charge.
            interval: index of their interval.

        Returns:
            (n,) pixels that store a threshold already and fire in `cycle` whatever its light; None
            if `expose` finds them itself.
        """
        ...


def join_words(parts: Sequence[tuple[Words, int]]) -> Words:
    """Words of consecutive calls as those of one. parts: words and number of cycles of each."""
    if len(parts) == 1:
        return parts[0][0]
    out = np.zeros((words_for(sum(cycles for _, cycles in parts)), parts[0][0].shape[1]), np.uint32)
    at = 0
    for words, cycles in parts:
        first, shift = divmod(at, WORD)
        for n, word in enumerate(words, first):
            out[n] |= word << np.uint32(shift)
            if shift and n + 1 < len(out):
                out[n + 1] |= word >> np.uint32(WORD - shift)
        at += cycles
    return out


def pending_of(pixels: object) -> npt.NDArray[np.float64] | float:
    """Share of a threshold, (n,), that dead times which last beyond the last latch will still lose;
    0 for tiers that lose it in the cycle of the spike."""
    pending: Callable[[], npt.NDArray[np.float64]] | None = getattr(pixels, "pending", None)
    return 0.0 if pending is None else pending()


class WrittenPixels:
    """Pixels whose registers are written.

    Args:
        phases: the registers between the writes.
        make: pixels with a threshold, in the state before the first cycle.
        rows: (n,) row of the chip of each pixel.
    """

    def __init__(
        self,
        phases: Sequence[Phase],
        make: Callable[[float], RewrittenPixels],
        rows: npt.NDArray[np.int64],
    ) -> None:
        self._phases, self._make, self._rows = phases, make, rows
        self._now = 0
        self._pixels = make(phases[0].threshold)

    def _inside(self, phase: Phase) -> Mask:
        """(n,) whether each pixel is read."""
        first, stop = phase.window
        return np.asarray((self._rows >= first) & (self._rows < stop))

    def _advance(self) -> Mask | None:
        """Goes on to the next phase; returns the pixels that fire in its first cycle."""
        before = self._phases[self._now]
        self._now += 1
        phase = self._phases[self._now]
        fresh = self._inside(phase) & ~self._inside(before)
        if phase.threshold == before.threshold and not fresh.any():
            return None
        pixels = self._make(phase.threshold)
        fires = pixels.take_over(self._pixels, phase.start, fresh, self._now << _INDEX)
        self._pixels = pixels
        return fires

    def expose(self, light: Light, start: int, cycles: int) -> Words:
        """Latched bits of cycles `start` to `start + cycles`; see `TierPixels`."""
        parts, stop = [], start + cycles
        while start < stop:
            fires = None
            while self._now + 1 < len(self._phases) and self._phases[self._now + 1].start <= start:
                fires = self._advance()
            last = self._now + 1 == len(self._phases)
            until = stop if last else min(stop, self._phases[self._now + 1].start)
            words = self._pixels.expose(light, start, until - start)
            inside = self._inside(self._phases[self._now])
            if fires is not None or not inside.all():
                words = np.where(inside, words, np.uint32(0))
            if fires is not None:
                words[0] |= (fires & inside).astype(np.uint32)
            parts.append((words, until - start))
            start = until
        return join_words(parts)

    def fraction(self) -> npt.NDArray[np.float64]:
        """Stored charge over the threshold of the current interval, (n,); 0 outside the window."""
        return np.where(self._inside(self._phases[self._now]), self._pixels.fraction(), 0.0)

    def pending(self) -> npt.NDArray[np.float64]:
        """See `pending_of`; 0 outside the window."""
        return np.where(self._inside(self._phases[self._now]), pending_of(self._pixels), 0.0)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next call depends on."""
        return {**self._pixels.state(), _PHASE: np.array([self._now])}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._now = int(state[_PHASE][0])
        self._pixels = self._make(self._phases[self._now].threshold)
        self._pixels.restore({key: value for key, value in state.items() if key != _PHASE})
