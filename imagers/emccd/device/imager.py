"""The whole EMCCD camera: light in, frames out, controlled by its registers.

The sequencer runs with clock resolution. Where a cycle takes another gain step, a word over SPI
moves the potentiometer, and the drive's loop follows; the gain of a frame is that of the mean peak
while its rows are read. The pixels of a frame are computed when its last pixel has
left, with the parameters of its cycle. The pixel model takes all rows of the image area, because
smear and blooming depend on them, and returns the rows of the window.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from cosim.clock import PS
from cosim.frames import Frame
from imagers.common.registers import register_of, write_instant
from imagers.common.scenery import Scenery
from imagers.common.trace import Signal, trace_ending, write_trace
from imagers.emccd.device.controller import EmccdSequencer
from imagers.emccd.device.cooling import Cooler
from imagers.emccd.device.sequencer import SIGNALS, Cycle, signal_changes
from imagers.emccd.device.sine_drive import (
    SPI_SIGNALS,
    Potentiometer,
    RunningDrive,
    SineDrive,
    word_clocks,
    word_edges,
)
from imagers.emccd.device.timing import Timing
from imagers.emccd.pixels import EmccdExposed, EmccdPixels, HighVoltage

_TRACED = 2
"""Number of frames in a trace."""
_SYNC = Signal("sync_in")


class Emccd:
    """The EMCCD; see `Imager`. The prefix `emccd_` of a register name may be omitted.

    Args:
        pixels: chip; None for the default.
        timing: timing of the sequencer; None for the default.
        drive: drive of the multiplication register; None for the default.
        pulses: instants of external sync, ps; a pulse is detected at the first edge not before it.
        cooler: determines the temperature of the chip at each frame, from its present state on;
            None for the constant temperature of the pixels.
        powered: instants at which the supplies are good and at which they are switched off, ps;
            None for ever. Cycles begin and frames end between them. From an instant above 0 the
            loop of the drive begins at 0 V.
    """

    name = "emccd"

    def __init__(
        self,
        pixels: EmccdPixels | None = None,
        timing: Timing | None = None,
        *,
        drive: SineDrive | None = None,
        pulses: Iterable[int] = (),
        cooler: Cooler | None = None,
        powered: tuple[int, int | None] = (0, None),
    ) -> None:
        self.pixels = pixels or EmccdPixels()
        self.timing = timing or Timing()
        if (self.timing.rows, self.timing.columns) != self.pixels.shape:
            raise ValueError(f"timing must be for {self.pixels.shape} pixels, not {self.timing}")
        hertz = self.timing.clock_hz
        self.drive = drive or SineDrive(HighVoltage(stages=self.pixels.stages), hertz=hertz)
        self.cooler = cooler
        # A cooler that has run before continues from its present state.
        self._cooled = 0 if cooler is None else cooler.samples * cooler.settings.sample
        self._clock = self.timing.clock
        self._pulses = [self._edge(ps) for ps in pulses]
        self._waiting: list[tuple[int, int, str, int]] = []  # (edge, order, register, value)
        self._written = self._now = 0
        self._cycles: list[Cycle] = []  # begun, not yet delivered
        self.sequencer = EmccdSequencer(self.timing, self._pulses, self._begin)
        self.potentiometer = Potentiometer()
        self._words: list[tuple[int, int]] = []  # (edge, code) of each word
        self._moves: list[tuple[int, int]] = []  # (edge, wiper) that the drive has not taken yet
        start, self._off = powered
        first = self._edge(start)
        code = self.potentiometer.wiper if start else 0  # before the run: as the register's reset
        self._running = RunningDrive(self.drive, code, first, cold=start > 0)
        if first:
            self.sequencer.reset(first)

    @property
    def now(self) -> int:
        """Present instant, ps."""
        return self._now

    def write(self, register: str, value: int, at: int | None = None) -> None:
        """See `Imager`. The write takes place at the first edge not before `at`, and affects cycles
        that begin at later edges. A write at 0 takes place before the first edge."""
        entry = register_of(self.sequencer.registers, register)
        when = write_instant(entry, register, value, at, self._now)
        edge = max(self._edge(when), self.sequencer.clock - 1) if when else -1
        insort(self._waiting, (edge, self._written, entry.name, value))
        self._written += 1
        self._strobe(self.sequencer.clock)

    def read(self, register: str) -> int:
        """See `Imager`."""
        registers = self.sequencer.registers
        return registers.read(register_of(registers, register).name)

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """See `Imager`. The times of a row are those of the exposure, between the two transfers. A
        frame contains the rows of the window, with all columns."""
        if scene.shape != self.pixels.shape:
            raise ValueError(f"scene must be {self.pixels.shape}, not {scene.shape}")
        if trace is not None:
            trace_ending(trace)
        traced: list[Cycle] = []
        on = until if self._off is None else min(until, self._off)
        stop = self._clock.cycle_at(on) + 1
        while (cycle := self._cycle(stop)) is not None:
            ready = self._clock.edge(cycle.ready)
            self._now = ready
            if len(traced) < _TRACED:
                traced.append(cycle)
            yield self._frame(cycle, scene, seed, kept)
        self._now = max(self._now, until)
        if trace is not None:
            self._write_trace(trace, [*traced, *self._cycles][:_TRACED], until)

    def _edge(self, ps: int) -> int:
        """The first edge that is not before an instant."""
        edge = self._clock.cycle_at(ps)
        return edge + (self._clock.edge(edge) < ps)

    def _strobe(self, clock: int) -> None:
        """Executes the writes whose edge has passed."""
        while self._waiting and self._waiting[0][0] < clock:
            _, _, name, value = self._waiting.pop(0)
            self.sequencer.registers.write(name, value)

    def _begin(self, cycle: Cycle) -> None:
        """Sends the word of a cycle whose gain step is another than that of the last word."""
        self._cycles.append(cycle)
        code = cycle.settings.gain_step
        if not self._words or self._words[-1][1] != code:
            self._words.append((cycle.start, code))
            for _, signal, value in word_edges(cycle.start, code):
                self.potentiometer.change(signal, value)
            self._moves.append((cycle.start + word_clocks(), self.potentiometer.wiper))

    def _peak(self, cycle: Cycle) -> float:
        """Mean peak of the high-voltage clock while the rows of a cycle are read, V."""
        while self._moves and self._moves[0][0] <= cycle.read_begin:
            self._running.set(*self._moves.pop(0))
        return self._running.mean_peak(cycle.read_begin, cycle.ready)

    def _cycle(self, stop: int) -> Cycle | None:
        """Runs edges before `stop` until the last pixel of a frame has left. Returns the cycle of
        the frame, or None."""
        while True:
            goal = stop
            if self._cycles:
                goal = min(goal, self._cycles[0].ready + 1)
            if self._waiting:
                goal = min(goal, self._waiting[0][0] + 1)
            begun = self.sequencer.run(goal)
            self._strobe(self.sequencer.clock)
            if self._cycles and self.sequencer.clock > self._cycles[0].ready:
                return self._cycles.pop(0)
            if not begun and self.sequencer.clock >= stop:
                return None

    def _frame(self, cycle: Cycle, scene: Scenery, seed: int, kept: frozenset[str]) -> Frame:
        rows, settings = self.timing.rows, cycle.settings
        begin = np.full(rows, self._clock.edge(cycle.exposure_begin), np.int64)
        end = np.full(rows, self._clock.edge(cycle.exposure_end), np.int64)
        ready = self._clock.edge(cycle.ready)
        kelvin = self.pixels.kelvin
        if self.cooler is not None:
            self.cooler.advance(self._cooled + ready)
            kelvin = self.cooler.kelvin
        peak = self._peak(cycle)
        gain = self.drive.voltage.gain_at(self.drive.at_transfer(peak), kelvin)
        exposed = EmccdExposed(
            lux_seconds=scene.lux_seconds(0, begin, end),
            seconds=(end - begin) / PS,
            waiting=cycle.waiting(),
            first=0,
            frame=cycle.number,
            read=(cycle.before, settings.rows),
            gain=gain,
            kelvin=kelvin,
            row_shift=self.timing.row_shift,
        )
        window = slice(cycle.before, cycle.before + settings.rows)
        state = {
            "exposure_steps": float(settings.steps),
            "gain_step": float(settings.gain_step),
            "gain": gain,
            "peak": peak,
            "first_row": float(settings.first),
            "rows": float(settings.rows),
            "external": float(settings.external),
            "frame_clocks": float(cycle.clocks),
            "kelvin": kelvin,
        }
        values = self.pixels.convert(exposed, seed, kept)
        return Frame(
            values, self.pixels.bits, cycle.number, begin[window], end[window], ready, state
        )

    def _write_trace(self, path: Path, cycles: list[Cycle], until: int) -> None:
        """Writes the signals of these cycles and the sync input up to the instant `until`."""
        edge = self._clock.edge
        changes = [change for cycle in cycles for change in signal_changes(cycle)]
        last = cycles[-1].end if cycles else 0
        starts = {cycle.start for cycle in cycles}
        for begin, code in self._words:
            changes += word_edges(begin, code) if begin in starts else ()
        for pulse in self._pulses:
            if pulse <= last:
                changes += [(pulse, _SYNC.name, 1), (pulse + 1, _SYNC.name, 0)]
        changes.sort(key=lambda change: change[0])  # stable: preserves the order of the sequencer
        records = ((edge(k), name, value) for k, name, value in changes if edge(k) <= until)
        write_trace(path, (*SIGNALS, *SPI_SIGNALS, _SYNC), records, top="emccd")
