"""`Timing`: clocks of lines and frames, and `FrameTiming`: the clocks of one frame's every edge.

Printed: a 20 MHz clock, a shortest exposure of 1 us by a register value of 14H, 100 frames/s, and a
work cycle of two phases, idle and work (document 001, sections 3.3, 4 and 5). Not printed, assumed:
the array's size, a work cycle of 20 clocks, 10 of each phase, pixels that leave at one a clock (or
as many as it takes) in work phases.

A frame begins (Vout) when row 0 is sampled; row r is sampled r lines later. Frame k + 1's exposure
of a row ends at the sample and begins at the row's reset, `exposure` clocks sooner. Hence hold =
frame time - exposure is the delay from one Vout to the release of the reset counter, and a frame
whose exposure does not fit is longer: frame time = hold + exposure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from cosim import Clock

__all__ = ["CLOCK_HZ", "FRAME_RATE", "MINIMUM_CLOCKS", "FrameTiming", "Timing"]

CLOCK_HZ: Final = 20_000_000
"""Document 001, section 3.3."""
MINIMUM_CLOCKS: Final = 0x14
"""Minimum-exposure register (section 3.3)."""
FRAME_RATE: Final = 100
"""Frames a second of its simulation (section 5)."""


_CLOCK: Final = Clock(CLOCK_HZ)


@dataclass(frozen=True)
class Timing:
    """Clocks of the sequencer. rows, columns: of the array, both even. cycle: clocks of a work
    cycle, half work, half idle. line, frame: clocks, whole work cycles; a frame of a long exposure
    is longer. turn: clocks from a row's sample to the release of its next reset, at the least: the
    sampled row's own readout. lanes: pixels that leave in a clock.
    """

    rows: int
    columns: int
    line: int
    frame: int
    cycle: int = 20
    turn: int = 40
    lanes: int = 1
    clock: Clock = _CLOCK

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
        """For an array: lines as long as the frame allows, lanes as many as the line asks for. The
        line is no power of two of work cycles, so that no reset meets another row's sample.
        ValueError where the frame is too short for its rows."""
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
        """Clocks of a work phase, the first of its cycle."""
        return self.cycle // 2

    @property
    def out_steps(self) -> int:
        """Steps of the column counter in a row: made even, for its Gray code."""
        steps = -(-self.columns // self.lanes)
        return steps + steps % 2

    @property
    def out_cycles(self) -> int:
        """Work cycles in which a row's pixels leave, after its own readout (`turn`)."""
        return -(-self.out_steps // self.work)

    @property
    def deciding(self) -> int:
        """Clocks from Vout to the end of the exposure selection: after the last row's pixels have
        left, one work cycle."""
        return (self.rows - 1) * self.line + self.turn + (self.out_cycles + 1) * self.cycle

    def period(self, exposure: int) -> int:
        """Clocks from one Vout to the next when the rows are exposed so many clocks for it."""
        return max(self.frame, -(-(exposure + self.turn) // self.cycle) * self.cycle)

    @property
    def longest_within(self) -> int:
        """Clocks of the longest exposure that does not lengthen a frame."""
        return self.frame - self.turn


class FrameTiming(NamedTuple):
    """One frame, in clocks. number: from 0. start: Vout, row 0's sample. exposure: of every row.
    period: from the Vout before. counter: reset counter at work, 1 or 2. line: of a row."""

    number: int
    start: int
    exposure: int
    period: int
    counter: int
    line: int

    @property
    def hold(self) -> int:
        """Clocks from the Vout before to the first reset (document: hold = frame - exposure)."""
        return self.period - self.exposure

    def reset(self, row: int) -> int:
        """Clock at which a row's reset ends: its exposure begins."""
        return self.start - self.exposure + row * self.line

    def sample(self, row: int) -> int:
        """Clock at which a row is sampled: its exposure ends."""
        return self.start + row * self.line
