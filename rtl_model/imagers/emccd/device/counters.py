"""The EMCCD's sequencer clock by clock, counters and all, as one would write it in Verilog: the
truth that `sequencer.py` and `bus_target.py` are held against."""

from __future__ import annotations

from rtl_model.imagers.emccd.device.sequencer import Phase
from rtl_model.imagers.emccd.device.timing import Settings, Timing

__all__ = ["CounterSequencer"]


class CounterSequencer:
    """One call a clock. Attributes are the state as it stands between edges.

    held: the parameters as they were last written. work: those of the cycle that runs.
    """

    def __init__(self, timing: Timing, held: Settings | None = None) -> None:
        self.timing = timing
        self.held = held or Settings()
        self.work = self.held
        self.phase = Phase.WAIT
        self.cycles = self.frames = self.lost = 0
        self._count = 0  # clocks left of the step that is done
        self._left = 0  # rows left of the phase that is done
        self._line = False  # a row is read: its pixels leave

    def tick(self, pulse: bool = False) -> dict[str, int]:
        """One edge, with or without a sync pulse at it; returns the signals of the clock after
        it."""
        if self._count:
            self._count -= 1
        if not self._count:
            self._next(pulse)
        elif pulse:
            self.lost += 1
        return self._signals()

    def _next(self, pulse: bool) -> None:
        """The step that was done is over: what comes now."""
        timing, work = self.timing, self.work
        match self.phase:
            case Phase.WAIT:
                return self._wait(pulse)
            case Phase.FIRST_TRANSFER:
                if self._row(timing.transfer):
                    self.phase, self._count = Phase.EXPOSURE, work.steps * timing.step
            case Phase.EXPOSURE:
                self._begin(Phase.SECOND_TRANSFER, timing.rows, timing.transfer)
            case Phase.SECOND_TRANSFER:
                if self._row(timing.transfer):
                    self.phase, self._count = Phase.CLEAR, timing.clear
            case Phase.CLEAR:
                self._begin(Phase.DUMP_BEFORE, timing.dark_rows + work.first, timing.dump)
                if not self._left:
                    self._begin(Phase.READOUT, work.rows, timing.shift)
            case Phase.DUMP_BEFORE:
                if self._row(timing.dump):
                    self._begin(Phase.READOUT, work.rows, timing.shift)
            case Phase.READOUT:
                if not self._line:
                    self._line, self._count = True, timing.line
                else:
                    self._line = False
                    if self._row(timing.shift):
                        self.frames += 1
                        after = timing.rows - timing.dark_rows - work.first - work.rows
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
        if self.held.external and not pulse:
            return
        if pulse and not self.held.external:
            self.lost += 1
        self.work = self.held.within(self.timing)
        self.cycles += 1
        self._begin(Phase.FIRST_TRANSFER, self.timing.rows, self.timing.transfer)

    def _begin(self, phase: Phase, rows: int, clocks: int) -> None:
        self.phase, self._left, self._count = phase, rows, clocks if rows else 0

    def _row(self, clocks: int) -> bool:
        """A row is done; whether it was the phase's last, else the next begins."""
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
