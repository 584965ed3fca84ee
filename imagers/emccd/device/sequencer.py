"""One cycle of the EMCCD: the clock edges of its phases, and its drive signals.

A cycle consists of: first frame transfer, exposure, second frame transfer, clear of the horizontal
register, dumped rows, rows that are read, dumped rows. The first transfer clears the charge that
was collected since the last cycle; the exposure begins at its end. `CounterSequencer` computes
the same clock by clock.

`CounterSequencer` has counters as in Verilog. It is the reference of this module and of
`controller.py`, in tests and in `viform paper`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
import numpy.typing as npt

from imagers.common.trace import Signal
from imagers.emccd.device.timing import Settings, Timing, frame_clocks

Clocks = npt.NDArray[np.int64]
SIGNALS: Final = (
    Signal("phase", 3),
    Signal("image_clock"),  # I-phi: shifts the image area, one pulse per row
    Signal("store_clock"),  # S-phi: shifts the store
    Signal("register_clock"),  # R-phi runs: one pixel per system clock
    Signal("dump_gate"),  # DG: the horizontal register is drained
    Signal("frame_sync"),
    Signal("line_sync"),  # a pixel of the 536 columns is at the output
)
"""Signals of a trace. A shift pulse is high for the first half of its clocks, rounded down."""


class Phase(IntEnum):
    """Phase of the sequencer; the values of the register `emccd_state`."""

    WAIT = 0
    FIRST_TRANSFER = 1
    EXPOSURE = 2
    SECOND_TRANSFER = 3
    CLEAR = 4
    DUMP_BEFORE = 5
    READOUT = 6
    DUMP_AFTER = 7


@dataclass(frozen=True)
class Cycle:
    """The edges of one cycle.

    Attributes:
        number: number of the cycle, from 0.
        start: edge at which it begins.
        timing: timing of the camera.
        settings: parameters of the cycle.
    """

    number: int
    start: int
    timing: Timing
    settings: Settings

    @property
    def before(self) -> int:
        """M: rows dumped before the window, including the dark rows at the head."""
        return self.timing.dark_rows + self.settings.first

    @property
    def after(self) -> int:
        """Rows dumped after the window."""
        return self.timing.rows - self.before - self.settings.rows

    @property
    def transfer(self) -> int:
        """Clocks of a frame transfer."""
        return self.timing.rows * self.timing.transfer

    @property
    def exposure_begin(self) -> int:
        """Edge at the end of the first transfer."""
        return self.start + self.transfer

    @property
    def exposure_end(self) -> int:
        """Edge at which the second transfer begins."""
        return self.exposure_begin + self.settings.steps * self.timing.step

    @property
    def clear_begin(self) -> int:
        """Edge at the end of the second transfer."""
        return self.exposure_end + self.transfer

    @property
    def dump_begin(self) -> int:
        """Edge at which the first row is dumped."""
        return self.clear_begin + self.timing.clear

    @property
    def read_begin(self) -> int:
        """Edge at which the first row of the window is shifted."""
        return self.dump_begin + self.before * self.timing.dump

    @property
    def ready(self) -> int:
        """Edge at which the last pixel of the window has left."""
        return self.read_begin + self.settings.rows * (self.timing.shift + self.timing.line)

    @property
    def end(self) -> int:
        """Edge at which the last row has been dumped. With internal sync, the next cycle begins
        here."""
        return self.ready + self.after * self.timing.dump

    @property
    def clocks(self) -> int:
        """Clocks of the cycle, by the closed form."""
        return frame_clocks(self.timing, self.settings)

    def phase(self, edge: int) -> Phase:
        """Phase of the clock that begins at `edge`."""
        bounds = (
            (self.exposure_begin, Phase.FIRST_TRANSFER),
            (self.exposure_end, Phase.EXPOSURE),
            (self.clear_begin, Phase.SECOND_TRANSFER),
            (self.dump_begin, Phase.CLEAR),
            (self.read_begin, Phase.DUMP_BEFORE),
            (self.ready, Phase.READOUT),
            (self.end, Phase.DUMP_AFTER),
        )
        if edge < self.start:
            return Phase.WAIT
        return next((phase for stop, phase in bounds if edge < stop), Phase.WAIT)

    def leaving(self) -> Clocks:
        """(rows,) edges at which each row of the chip leaves the store: the first pixel clock of a
        row that is read, or the shift of a row that is dumped."""
        timing = self.timing
        row = np.arange(timing.rows, dtype=np.int64)
        read = row - self.before
        dumped = self.dump_begin + row * timing.dump
        line = timing.shift + timing.line
        inside = self.read_begin + read * line + timing.shift
        later = self.ready + (read - self.settings.rows) * timing.dump
        return np.where(read < 0, dumped, np.where(read < self.settings.rows, inside, later))

    def waiting(self) -> npt.NDArray[np.float64]:
        """(rows,) time from the end of exposure to `leaving`, s, in which dark current and
        clock-induced charge accumulate."""
        return (self.leaving() - self.exposure_end) / self.timing.clock_hz


def signal_changes(cycle: Cycle) -> Iterator[tuple[int, str, int]]:
    """Yields (edge, signal, value) of one cycle in order. The last changes set all signals low.
    Some entries repeat the present value of a signal."""
    timing = cycle.timing
    yield cycle.start, "phase", Phase.FIRST_TRANSFER
    yield from _shifts(cycle.start, timing.rows, timing.transfer, ("image_clock", "store_clock"))
    yield cycle.exposure_begin, "phase", Phase.EXPOSURE
    yield cycle.exposure_end, "phase", Phase.SECOND_TRANSFER
    yield from _shifts(
        cycle.exposure_end, timing.rows, timing.transfer, ("image_clock", "store_clock")
    )
    yield cycle.clear_begin, "phase", Phase.CLEAR
    yield cycle.clear_begin, "dump_gate", 1
    if cycle.before:
        yield cycle.dump_begin, "phase", Phase.DUMP_BEFORE
        yield from _shifts(cycle.dump_begin, cycle.before, timing.dump, ("store_clock",))
    yield cycle.read_begin, "phase", Phase.READOUT
    yield cycle.read_begin, "dump_gate", 0
    yield cycle.read_begin, "frame_sync", 1
    for row in range(cycle.settings.rows):
        begin = cycle.read_begin + row * (timing.shift + timing.line)
        yield from _shifts(begin, 1, timing.shift, ("store_clock",))
        pixels = begin + timing.shift
        yield pixels, "register_clock", 1
        yield pixels + timing.transition, "line_sync", 1
        yield pixels + timing.line, "register_clock", 0
        yield pixels + timing.line, "line_sync", 0
    yield cycle.ready, "frame_sync", 0
    if cycle.after:
        yield cycle.ready, "phase", Phase.DUMP_AFTER
        yield cycle.ready, "dump_gate", 1
        yield from _shifts(cycle.ready, cycle.after, timing.dump, ("store_clock",))
    yield cycle.end, "dump_gate", 0
    yield cycle.end, "phase", Phase.WAIT


def _shifts(
    begin: int, count: int, clocks: int, names: tuple[str, ...]
) -> Iterator[tuple[int, str, int]]:
    for shift in range(count):
        for name in names:
            yield begin + shift * clocks, name, 1
        for name in names:
            yield begin + shift * clocks + clocks // 2, name, 0


class CounterSequencer:
    """The sequencer; one call of `tick` per clock.

    Attributes:
        written: parameters last written.
        active: parameters of the present cycle.
        phase: present phase.
        cycles, frames, lost: numbers of cycles begun, frames read, and pulses lost.
    """

    def __init__(self, timing: Timing, written: Settings | None = None) -> None:
        self.timing = timing
        self.written = written or Settings()
        self.active = self.written
        self.phase = Phase.WAIT
        self.cycles = self.frames = self.lost = 0
        self._count = 0  # remaining clocks of the present step
        self._left = 0  # remaining rows of the present phase
        self._line = False  # whether the pixels of a row leave

    def tick(self, pulse: bool = False) -> dict[str, int]:
        """Runs one edge, with or without a sync pulse. Returns the signals of the clock after
        it."""
        if self._count:
            self._count -= 1
        if not self._count:
            self._next(pulse)
        elif pulse:
            self.lost += 1
        return self._signals()

    def _next(self, pulse: bool) -> None:
        """Starts the next step."""
        timing, active = self.timing, self.active
        match self.phase:
            case Phase.WAIT:
                return self._wait(pulse)
            case Phase.FIRST_TRANSFER:
                if self._row(timing.transfer):
                    self.phase, self._count = Phase.EXPOSURE, active.steps * timing.step
            case Phase.EXPOSURE:
                self._begin(Phase.SECOND_TRANSFER, timing.rows, timing.transfer)
            case Phase.SECOND_TRANSFER:
                if self._row(timing.transfer):
                    self.phase, self._count = Phase.CLEAR, timing.clear
            case Phase.CLEAR:
                self._begin(Phase.DUMP_BEFORE, timing.dark_rows + active.first, timing.dump)
                if not self._left:
                    self._begin(Phase.READOUT, active.rows, timing.shift)
            case Phase.DUMP_BEFORE:
                if self._row(timing.dump):
                    self._begin(Phase.READOUT, active.rows, timing.shift)
            case Phase.READOUT:
                if not self._line:
                    self._line, self._count = True, timing.line
                else:
                    self._line = False
                    if self._row(timing.shift):
                        self.frames += 1
                        after = timing.rows - timing.dark_rows - active.first - active.rows
                        self._begin(Phase.DUMP_AFTER, after, timing.dump)
                        if not self._left:
                            self.phase = Phase.WAIT
                            return self._wait(pulse)
            case Phase.DUMP_AFTER:
                if self._row(timing.dump):
                    self.phase = Phase.WAIT
                    return self._wait(pulse)
        if pulse:
            self.lost += 1
        return None

    def _wait(self, pulse: bool) -> None:
        if self.written.external and not pulse:
            return
        if pulse and not self.written.external:
            self.lost += 1
        self.active = self.written.within(self.timing)
        self.cycles += 1
        self._begin(Phase.FIRST_TRANSFER, self.timing.rows, self.timing.transfer)

    def _begin(self, phase: Phase, rows: int, clocks: int) -> None:
        self.phase, self._left, self._count = phase, rows, clocks if rows else 0

    def _row(self, clocks: int) -> bool:
        """Ends a row and begins the next one. Returns whether it was the last of the phase."""
        self._left -= 1
        if self._left:
            self._count = clocks
        return not self._left

    def _signals(self) -> dict[str, int]:
        timing, phase = self.timing, self.phase
        whole = {
            Phase.FIRST_TRANSFER: timing.transfer,
            Phase.SECOND_TRANSFER: timing.transfer,
            Phase.DUMP_BEFORE: timing.dump,
            Phase.DUMP_AFTER: timing.dump,
            Phase.READOUT: 0 if self._line else timing.shift,
        }.get(phase, 0)
        pulse = int(whole > 0 and whole - self._count < whole // 2)
        transfer = phase in (Phase.FIRST_TRANSFER, Phase.SECOND_TRANSFER)
        column = timing.line - self._count
        return {
            "phase": int(phase),
            "image_clock": int(transfer and pulse),
            "store_clock": pulse,
            "register_clock": int(self._line),
            "dump_gate": int(phase in (Phase.CLEAR, Phase.DUMP_BEFORE, Phase.DUMP_AFTER)),
            "frame_sync": int(phase == Phase.READOUT),
            "line_sync": int(self._line and column >= timing.transition),
        }
