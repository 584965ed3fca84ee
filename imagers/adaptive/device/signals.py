"""The signals of the sequencer, from the timing of the frames (document 001, figures 4 and 5).

- Vout, Hout: work phase after the sample of row 0, and of any row.
- Hrst1, Hrst2: reset of the row that the reset counter selects; its falling edge begins exposure.
- sampling: idle phase that ends with the sample of a row, in which nothing else switches.
- Pout: work phases in which pixels leave and are scanned.
- select: work cycle of the exposure decision.
- row, reset1, reset2: codes of the counters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from heapq import merge

from imagers.adaptive.device.codes import Code, gray_bits, ring
from imagers.adaptive.device.timing import FrameTiming, Timing
from imagers.common.trace import Signal

__all__ = ["Change", "signal_list", "signals_of"]

Change = tuple[int, str, int]
"""(clock, signal, new value)."""


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
