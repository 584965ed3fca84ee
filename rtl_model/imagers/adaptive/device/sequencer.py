"""`Sequencer`: every reset and sample to the clock, from the exposures alone.

Two reset counters take turns (document 001, section 4.2). A new exposure is given to the one that
is idle, while the other finishes its frame; an exposure that stays is given to the one that had it.
Two are enough: the resets of frame k + 1 begin after row 0's sample of frame k and before that of
frame k + 1, and last at most a frame, so those of frame k + 3 begin after those of frame k + 1 end.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from rtl_model.imagers.adaptive.device.timing import FrameTiming, Timing

__all__ = ["Sequencer", "actual_exposures", "disturbed", "frames_of"]


class Sequencer:
    """step() makes the next frame. origin: clock of power-on, where frame 0's hold begins."""

    def __init__(self, timing: Timing, origin: int = 0) -> None:
        self.timing = timing
        self._number, self._vout, self._counter = 0, origin, 1
        self._exposure: int | None = None

    def step(self, exposure: int) -> FrameTiming:
        """The next frame, with rows exposed so many clocks. ValueError for fewer than one."""
        if exposure < 1:
            raise ValueError(f"exposure must be a clock or more, not {exposure}")
        if self._exposure is not None and exposure != self._exposure:
            self._counter = 3 - self._counter
        period = self.timing.period(exposure)
        self._vout += period
        made = FrameTiming(
            self._number, self._vout, exposure, period, self._counter, self.timing.line
        )
        self._number += 1
        self._exposure = exposure
        return made


def frames_of(timing: Timing, exposures: Iterable[int]) -> list[FrameTiming]:
    """The frames of these exposures, clocks, from power-on."""
    sequencer = Sequencer(timing)
    return [sequencer.step(each) for each in exposures]


def actual_exposures(
    timing: Timing, frames: Sequence[FrameTiming], counters: int = 2
) -> npt.NDArray[np.int64]:
    """(frames, rows) clocks from each row's last reset to its sample, as counters make them.

    counters: 2 as built; 1 is the plain rolling shutter, whose counter starts again when a new hold
    has passed although its frame is not finished: later rows are then not reset at all, and gather
    from their last sample on, which resets as well.
    """
    rows = np.arange(timing.rows, dtype=np.int64)
    begins = np.array([f.reset(0) for f in frames])
    samples = np.array([f.start for f in frames])[:, None] + rows * timing.line
    made = np.empty(samples.shape, np.int64)
    for n in range(len(frames)):
        resets = begins[n] + rows * timing.line
        if counters == 1 and n + 1 < len(frames):
            before = samples[n - 1] if n else np.zeros(timing.rows, np.int64)
            resets = np.where(resets < begins[n + 1], resets, before)
        made[n] = samples[n] - resets
    return made


def disturbed(timing: Timing, frames: Sequence[FrameTiming]) -> int:
    """Resets of the last of these frames that fall into another row's sampling phase: the idle
    phase before a sample of these frames, in which nothing else may switch. None do for exposures
    of the automatic at the printed settings; a user's own may."""
    last = frames[-1]
    found = 0
    for frame in frames:
        apart = frame.start - last.reset(0)
        for shift in {apart // timing.line, -(-apart // timing.line)}:
            # row q of `frame` is sampled as row q + shift of `last` is reset, to this many clocks
            gap = apart - shift * timing.line
            own = frame is last and shift == 0
            if abs(gap) < timing.work and not own:
                found += max(0, timing.rows - abs(shift))
    return found
