"""Signals of the sequencer, codes of its counters, and the charge that their toggles couple onto
sampled pixels.

Counters run in Gray code, or in binary code for comparison. Each step of a Gray code changes one
bit (document 001, section 4). A cyclic Gray code with fewer states than its bits allow is taken
from the middle of the reflected code, which requires an even number of states.

The signals, from the timing of the frames (document 001, figures 4 and 5).

- Vout, Hout: work phase after the sample of row 0, and of any row.
- Hrst1, Hrst2: reset of the row that the reset counter selects; its falling edge begins exposure.
- sampling: idle phase that ends with the sample of a row, in which nothing else switches.
- Pout: work phases in which pixels leave and are scanned.
- select: work cycle of the exposure decision.
- row, reset1, reset2: codes of the counters.

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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import merge
from typing import Final, Literal, TypeVar

import numpy as np
import numpy.typing as npt

from imagers.adaptive.device.timing import FrameTiming, Timing
from imagers.common.trace import Signal

Code = Literal["gray", "binary"]
Number = TypeVar("Number", int, npt.NDArray[np.int64])
Change = tuple[int, str, int]
"""(clock, signal, new value)."""
_SPENT: Final = 40.0
"""Time constants after which a toggle is forgotten; exp(-40) is below the rounding of a float."""
Counts = npt.NDArray[np.int64]


def gray(number: Number) -> Number:
    """Reflected Gray code."""
    return number ^ (number >> 1)


def gray_bits(states: int) -> int:
    """Bits of a Gray counter with this number of states. Raises ValueError for an odd number."""
    if states < 2 or states % 2:
        raise ValueError(f"states of a Gray counter must be even, not {states}")
    return (states - 1).bit_length()


def ring(number: Number, states: int, code: Code = "gray") -> Number:
    """Code of a cyclic counter. A Gray counter changes one bit in each step, also from the last
    state to the first; a binary one changes all bits that a carry passes."""
    if code == "binary":
        return number % states
    spare = (1 << gray_bits(states)) - states
    return gray(number % states + spare // 2)


def signal_list(timing: Timing, code: Code = "gray") -> tuple[Signal, ...]:
    """All signals of the sequencer, with width and value at power-on."""
    bits, first = gray_bits(timing.rows), ring(0, timing.rows, code)
    lines = ("Vout", "Hout", "Hrst1", "Hrst2", "sampling", "Pout", "select")
    codes = ("row", "reset1", "reset2")
    return (
        *(Signal(name) for name in lines),
        *(Signal(name, bits, first) for name in codes),
    )


def signals_of(
    timing: Timing, frames: Sequence[FrameTiming], code: Code = "gray"
) -> Iterator[Change]:
    """All changes of the signals during these frames, in order of clocks."""
    parts = [part(timing, frame, code) for frame in frames for part in (_resets, _reading)]
    return merge(*parts, key=lambda change: change[0])


def _resets(timing: Timing, frame: FrameTiming, code: Code) -> Iterator[Change]:
    pulse, counter = f"Hrst{frame.counter}", f"reset{frame.counter}"
    for row in range(timing.rows):
        end = frame.reset(row)
        step = -(-end // timing.cycle) * timing.cycle
        yield end - timing.work, pulse, 1
        yield end, pulse, 0
        yield step, counter, ring(row + 1, timing.rows, code)


def _reading(timing: Timing, frame: FrameTiming, code: Code) -> Iterator[Change]:
    for row in range(timing.rows):
        at = frame.sample(row)
        yield at - timing.work, "sampling", 1
        yield at, "sampling", 0
        yield at, "Hout", 1
        if row == 0:
            yield at, "Vout", 1
        yield at + timing.work, "Hout", 0
        if row == 0:
            yield at + timing.work, "Vout", 0
        yield at + timing.turn, "row", ring(row + 1, timing.rows, code)
        for cycle in range(timing.out_cycles):
            start = at + timing.turn + cycle * timing.cycle
            yield start, "Pout", 1
            yield start + timing.work, "Pout", 0
    yield frame.start + timing.deciding - timing.cycle, "select", 1
    yield frame.start + timing.deciding, "select", 0


@dataclass(frozen=True)
class Coupling:
    """How switching logic couples onto the pixels; its sizes are assumed.

    Attributes:
        charge: charge that a toggle couples onto a pixel at its instant, e.
        time_constant: time constant of its decay, s.
        code: code of the counters.
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
        code: code of the counters.

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
