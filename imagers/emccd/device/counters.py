"""The sequencer of the EMCCD clock by clock, with counters as in Verilog: the reference for
`sequencer.py` and `bus_target.py`, in tests and in `viform paper`."""

from __future__ import annotations

from imagers.emccd.device.sequencer import Phase
from imagers.emccd.device.timing import Settings, Timing

__all__ = ["CounterSequencer"]


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
