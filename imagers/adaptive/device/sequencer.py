"""The sequencer: the clock of every reset and sample, computed from the exposures.

Two reset counters take turns (document 001, section 4.2). A new exposure goes to the idle counter
while the other finishes its frame; an unchanged exposure stays with its counter. Two counters
suffice: the resets of frame k + 1 begin after the sample of row 0 in frame k and before that in
frame k + 1, and last at most a frame. So the resets of frame k + 3 begin after those of frame k + 1
have ended.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from imagers.adaptive.device.timing import FrameTiming, Timing

__all__ = ["Sequencer", "actual_exposures", "disturbed", "frames_of"]


class Sequencer:
    """Generates frame after frame by step().

    Args:
        timing: timing of the array.
        origin: clock of power-on, at which the hold of frame 0 begins.
    """

    def __init__(self, timing: Timing, origin: int = 0) -> None:
        self.timing = timing
        self._number, self._vout, self._counter = 0, origin, 1
        self._exposure: int | None = None

    def step(self, exposure: int) -> FrameTiming:
        """The next frame, with an exposure in clocks. Raises ValueError for less than one."""
        if exposure < 1:
            raise ValueError(f"exposure must be a clock or more, not {exposure}")
        if self._exposure is not None and exposure != self._exposure:
            self._counter = 3 - self._counter
        period = self.timing.period(exposure)
        self._vout += period
        frame = FrameTiming(
            self._number, self._vout, exposure, period, self._counter, self.timing.line
        )
        self._number += 1
        self._exposure = exposure
        return frame


def frames_of(timing: Timing, exposures: Iterable[int]) -> list[FrameTiming]:
    """The frames with these exposures (clocks) from power-on."""
    sequencer = Sequencer(timing)
    return [sequencer.step(each) for each in exposures]


def actual_exposures(
    timing: Timing, frames: Sequence[FrameTiming], counters: int = 2
) -> npt.NDArray[np.int64]:
    """Exposure of each row: clocks from its last reset to its sample.

    Args:
        timing: timing of the array.
        frames: n consecutive frames from power-on.
        counters: number of reset counters: 2 as built, or 1 for a plain rolling shutter. A single
            counter restarts after the next hold although its frame is not finished. The remaining
            rows are then not reset, and integrate from their last sample, which also resets.

    Returns:
        (n, rows) clocks, int64.
    """
    rows = np.arange(timing.rows, dtype=np.int64)
    begins = np.array([f.reset(0) for f in frames])
    samples = np.array([f.start for f in frames])[:, None] + rows * timing.line
    exposures = np.empty(samples.shape, np.int64)
    for n in range(len(frames)):
        resets = begins[n] + rows * timing.line
        if counters == 1 and n + 1 < len(frames):
            before = samples[n - 1] if n else np.zeros(timing.rows, np.int64)
            resets = np.where(resets < begins[n + 1], resets, before)
        exposures[n] = samples[n] - resets
    return exposures


def disturbed(timing: Timing, frames: Sequence[FrameTiming]) -> int:
    """Number of resets of the last frame that fall into the sampling phase of another row.

    The sampling phase is the idle phase before a sample, in which nothing else may switch. The
    automatic exposures at the settings of the document cause none; an exposure set by the user may.
    """
    last = frames[-1]
    count = 0
    for frame in frames:
        apart = frame.start - last.reset(0)
        for shift in {apart // timing.line, -(-apart // timing.line)}:
            # row q of `frame` is sampled as row q + shift of `last` is reset, to this many clocks
            gap = apart - shift * timing.line
            same_row = frame is last and shift == 0
            if abs(gap) < timing.work and not same_row:
                count += max(0, timing.rows - abs(shift))
    return count
