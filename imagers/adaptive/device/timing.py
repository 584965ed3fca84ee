"""Clocks of lines and frames (`Timing`), of the events of one frame (`FrameTiming`), and of every
reset and sample of a run (`Sequencer`).

Document 001 (sections 3.3, 4 and 5) states a clock of 20 MHz, a shortest exposure of 1 us with a
register value of 14H, 100 frames/s, and a work cycle of two phases, idle and work. Assumed are the
size of the array, a work cycle of 20 clocks with 10 in each phase, and a readout of one pixel per
clock, or more if necessary, in work phases.

A frame begins (Vout) with the sample of row 0; row r is sampled r lines later. The exposure of a
row begins at its reset and ends at its sample, `exposure` clocks later. The reset counter is
released hold = frame time - exposure after the preceding Vout. A frame becomes longer if its
exposure does not fit: frame time = hold + exposure.

The sequencer computes them from the exposures. Two reset counters take turns (document 001, section
4.2). A new exposure goes to the idle counter while the other finishes its frame; an unchanged
exposure stays with its counter. Two counters suffice: the resets of frame k + 1 begin after the
sample of row 0 in frame k and before that in frame k + 1, and last at most a frame. So the resets
of frame k + 3 begin after those of frame k + 1 have ended.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import Clock

CLOCK_HZ: Final = 20_000_000
"""Document 001, section 3.3."""
MINIMUM_CLOCKS: Final = 0x14
"""Value of the minimum-exposure register (document 001, section 3.3)."""
FRAME_RATE: Final = 100
"""Frame rate in the document's simulation (section 5), Hz."""


_CLOCK: Final = Clock(CLOCK_HZ)


@dataclass(frozen=True)
class Timing:
    """Timing of the sequencer, in clocks.

    Attributes:
        rows, columns: size of the array, both even.
        line: clocks of a line, whole work cycles.
        frame: clocks of a frame, whole work cycles; a frame with a long exposure is longer.
        cycle: clocks of a work cycle; half of them work, half idle.
        turn: least number of clocks from the sample of a row to the end of its next reset, in which
            the row is transferred to the readout.
        lanes: pixels that leave per clock.
        clock: clock of the sequencer.
        timer_bits: bits of the free-running counter of work cycles.
    """

    rows: int
    columns: int
    line: int
    frame: int
    cycle: int = 20
    turn: int = 40
    lanes: int = 1
    clock: Clock = _CLOCK
    timer_bits: int = 32

    def __post_init__(self) -> None:
        for name in ("rows", "columns"):
            if getattr(self, name) < 2 or getattr(self, name) % 2:
                raise ValueError(
                    f"{name} must be even, for a Gray counter, not {getattr(self, name)}"
                )
        if self.cycle % 2 or self.cycle < 4:
            raise ValueError(f"cycle must be even clocks, 4 or more, not {self.cycle}")
        for name in ("line", "frame", "turn"):
            if getattr(self, name) % self.cycle or getattr(self, name) < self.cycle:
                raise ValueError(
                    f"{name} must be work cycles of {self.cycle} clocks, not {getattr(self, name)}"
                )
        needed = self.turn + (self.out_cycles + 2) * self.cycle
        if self.line < needed:
            raise ValueError(f"line must be {needed} clocks or more, not {self.line}")
        if self.frame < self.rows * self.line + self.cycle:
            raise ValueError(f"frame must hold {self.rows} lines and a cycle, not {self.frame}")

    @classmethod
    def of(cls, rows: int, columns: int, frame_rate: float = FRAME_RATE) -> Timing:
        """The timing of an array: lines as long as the frame allows, and as many lanes as a line
        requires. The number of work cycles of a line is not a power of two, so that no reset
        coincides with the sample of another row.

        Args:
            rows, columns: size of the array.
            frame_rate: Hz.

        Raises ValueError for a frame that is too short for its rows.
        """
        cycle = 20
        frame = round(CLOCK_HZ / frame_rate) // cycle
        line = (frame - 1) // max(rows, 1)
        if line & (line - 1) == 0:
            line -= 1
        if line < 5:
            raise ValueError(f"frame_rate must leave {rows} lines 5 us each, not {frame_rate:g}")
        lanes = -(-columns // ((line - 4) * (cycle // 2)))
        return cls(rows, columns, line * cycle, frame * cycle, cycle, lanes=lanes)

    @property
    def work(self) -> int:
        """Clocks of the work phase, the first half of a work cycle."""
        return self.cycle // 2

    @property
    def out_steps(self) -> int:
        """Steps of the column counter in a row; even, for its Gray code."""
        steps = -(-self.columns // self.lanes)
        return steps + steps % 2

    @property
    def out_cycles(self) -> int:
        """Work cycles in which the pixels of a row leave, after `turn`."""
        return -(-self.out_steps // self.work)

    @property
    def deciding(self) -> int:
        """Clocks from Vout to the end of the exposure decision, which takes one work cycle after
        the pixels of the last row have left."""
        return (self.rows - 1) * self.line + self.turn + (self.out_cycles + 1) * self.cycle

    def period(self, exposure: int) -> int:
        """Clocks from one Vout to the next, for a next frame with this exposure, clocks."""
        return max(self.frame, -(-(exposure + self.turn) // self.cycle) * self.cycle)


class FrameTiming(NamedTuple):
    """The timing of one frame, in clocks.

    Attributes:
        number: number of the frame, from 0.
        start: clock of Vout, the sample of row 0.
        exposure: exposure of every row.
        period: clocks from the preceding Vout.
        counter: number of its reset counter, 1 or 2.
        line: clocks of a line.
    """

    number: int
    start: int
    exposure: int
    period: int
    counter: int
    line: int

    @property
    def hold(self) -> int:
        """Clocks from the preceding Vout to the first reset (hold = frame - exposure)."""
        return self.period - self.exposure

    def reset(self, row: int) -> int:
        """Clock at which the reset of a row ends and its exposure begins."""
        return self.start - self.exposure + row * self.line

    def sample(self, row: int) -> int:
        """Clock at which a row is sampled and its exposure ends."""
        return self.start + row * self.line


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
