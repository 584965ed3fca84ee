"""The toggles of the counters, and the charge that they couple onto the sampled pixels.

Document 001 (section 4) lets the counters run in Gray code and in work phases only, so that logic
does not disturb the pixels; it prints no size of the disturbance. Assumed is that every bit that
toggles draws the same charge from a common supply, whichever way it turns, and that the supply
recovers with one time constant tau. A row that is sampled at s then takes up

    q sum over the toggles at t < s of exp(-(s - t) / tau)

in all of its columns, which are sampled together. Counters are those of work cycles, of columns, of
rows, and the two of resets. Clock, phase ring and line pulses are not modelled: they are the same
in both codes and at the same place before every sample. Output pads are not modelled either.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from imagers.adaptive.device.codes import Code, ring
from imagers.adaptive.device.timing import FrameTiming, Timing

__all__ = ["Coupling", "row_kicks", "toggles"]

_SPENT: Final = 40.0
"""Time constants after which a toggle is forgotten; exp(-40) is below the rounding of a float."""

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Coupling:
    """How switching logic couples onto the pixels; its sizes are assumed.

    Attributes:
        charge: that a toggle couples onto a pixel at its instant, e.
        time_constant: with which it decays, s.
        code: of the counters.
        idle: whether the sample ends an idle phase. Otherwise the halves of the work cycle change
            places: counters run in the half that ends with the sample.
    """

    charge: float
    time_constant: float
    code: Code = "gray"
    idle: bool = True

    def __post_init__(self) -> None:
        if not 0 <= self.charge < math.inf:
            raise ValueError(f"charge must be finite and not negative, not {self.charge:g}")
        if not 0 < self.time_constant < math.inf:
            raise ValueError(f"time_constant must be positive, not {self.time_constant:g}")


def toggles(
    timing: Timing, frames: Sequence[FrameTiming], begin: int, end: int, code: Code = "gray"
) -> tuple[Counts, Counts]:
    """Steps of all counters in a span of clocks, in no order, with idle phases.

    Args:
        timing: timing of the array.
        frames: all frames with a reset or a read in the span.
        begin, end: first clock of the span, and the one after the last.
        code: of the counters.

    Returns:
        Clock of each step, and number of bits that toggle in it.
    """

    def bits(steps: Counts, states: int) -> Counts:
        changed = ring(steps - 1, states, code) ^ ring(steps, states, code)
        return np.bitwise_count(changed).astype(np.int64)

    cycle, rows, columns = timing.cycle, np.arange(timing.rows), np.arange(timing.out_steps)
    work_cycles = np.arange(max(-(-begin // cycle), 1), -(-end // cycle))
    clocks, changed = [work_cycles * cycle], [bits(work_cycles, 1 << timing.timer_bits)]
    by_row, by_column = bits(rows + 1, timing.rows), bits(columns + 1, timing.out_steps)
    leaving = timing.turn + columns // timing.work * cycle + columns % timing.work
    for frame in frames:
        samples = frame.start + rows * timing.line
        reset = samples - frame.exposure
        clocks += [-(-reset // cycle) * cycle, samples + timing.turn]
        changed += [by_row, by_row]
        if frame.start < end:
            clocks.append((samples[:, None] + leaving).reshape(-1))
            changed.append(np.tile(by_column, timing.rows))
    clock = np.concatenate(clocks)
    inside = (begin <= clock) & (clock < end)
    return clock[inside], np.concatenate(changed)[inside]


def row_kicks(
    timing: Timing, frames: Sequence[FrameTiming], number: int, coupling: Coupling
) -> npt.NDArray[np.float64]:
    """(rows,) charge that switching logic adds to every pixel of a row at its sample, e.

    Args:
        timing: timing of the array.
        frames: consecutive frames; of those after frame `number`, only the next one matters.
        number: index in `frames` of the frame that is sampled.
        coupling: code, phases, and size of a toggle.
    """
    samples = frames[number].start + np.arange(timing.rows) * timing.line
    fade = 1 / (coupling.time_constant * timing.clock.hz)
    begin = int(samples[0]) - math.ceil(_SPENT / fade)
    first = bisect_left(frames, begin - timing.deciding, key=lambda frame: frame.start)
    near = frames[first : number + 2]
    clock, bits = toggles(timing, near, begin, int(samples[-1]), coupling.code)
    clock += 0 if coupling.idle else timing.cycle - timing.work
    row = np.searchsorted(samples, clock, side="right")
    clock, bits, row = (each[row < timing.rows] for each in (clock, bits, row))
    weights = coupling.charge * bits * np.exp((clock - samples[row]) * fade)
    kicks = np.bincount(row, weights, timing.rows).astype(np.float64)
    kept = math.exp(-timing.line * fade)
    for r in range(1, timing.rows):
        kicks[r] += kept * kicks[r - 1]
    return kicks
