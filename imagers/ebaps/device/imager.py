"""The complete EBAPS imager: pixels, sequencer, and the board's frame memory."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame
from imagers.common.registers import register_of, write_instant
from imagers.common.scenery import Scenery
from imagers.common.trace import Record, Signal, write_trace
from imagers.ebaps.board.memory import BurstMemory
from imagers.ebaps.board.timing import FrameMemory, Timing
from imagers.ebaps.device.clocked_board import Board, Sent
from imagers.ebaps.device.drive import DRIVE_SIGNALS, drive_records, late_resets, row_times
from imagers.ebaps.device.exposure import DARKS, mean_of_four, subtract
from imagers.ebaps.device.sequencer import Read, Sequencer, Shot
from imagers.ebaps.pixels import EbapsPixels
from sensor.frame_pixels import Exposed

Image = npt.NDArray[np.uint16]
SIGNALS = (*DRIVE_SIGNALS, Signal("read"), Signal("key"), Signal("exposure_ns", 26))
"""Signals of a trace: drive signals, rows being read, KEY and exposure as the frame took them."""
TRACED = 8
"""Frames in a trace."""


class Ebaps:
    """See `Imager`. pixels: at most the size of the timing; a smaller array is the upper left
    corner, with its row times, and the mean is over its pixels only. memory: frame memory;
    `BurstMemory` if None. board: the frame memory with all that follows it, clock by clock for its
    first frames; None for none.

    A dark frame (KEY = 1) is delivered unchanged; from a live frame the mean of four dark frames is
    subtracted if four are stored. The `state` of a frame has its exposure, voltage, mean,
    `raw_mean`, the judgement of the loop, and the number of rows with a late reset (`resets`).
    """

    name = "ebaps"

    def __init__(
        self, pixels: EbapsPixels | None = None, *, memory: FrameMemory | None = None,
        timing: Timing | None = None, board: Board | None = None,
    ) -> None:  # fmt: skip
        self.pixels = EbapsPixels() if pixels is None else pixels
        self.timing = Timing() if timing is None else timing
        height, width = self.pixels.shape
        if height > self.timing.rows or width > self.timing.columns:
            raise ValueError(f"pixels must fit {self.timing.rows} x {self.timing.columns}")
        self.board = board
        self.memory: FrameMemory = board or (BurstMemory() if memory is None else memory)
        self.sequencer = Sequencer(self._expose, self.timing)
        self.now = 0
        self._writes: list[tuple[int, int, str, int]] = []
        self._order = 0
        self._at: dict[int, EbapsPixels] = {}
        self._shown: Image | None = None
        self._raw_mean = 0.0
        self._times: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]] | None = None
        self._late = 0
        self._film: tuple[Scenery, int, frozenset[str]] | None = None

    def write(self, register: str, value: int, at: int | None = None) -> None:
        """See `Imager`; the prefix `ebaps_` of a name is optional. InputError for an unknown or
        read-only register, a value that does not fit, or a time in the past."""
        registers = self.sequencer.registers
        entry = register_of(registers, register)
        when = write_instant(entry, register, value, at, self.now)
        if when == self.now:
            self._until(when)
            registers.write(entry.name, value)
            return
        self._order += 1
        heapq.heappush(self._writes, (when, self._order, entry.name, value))

    def read(self, register: str) -> int:
        """See `Imager`. InputError for an unknown register."""
        registers = self.sequencer.registers
        return registers.read(register_of(registers, register).name)

    def store_darks(self, at: int | None = None) -> None:
        """Sets KEY to 1 at this time (ps; now if None) for four frames, then to 0."""
        when = self.now if at is None else at
        self.write("ebaps_key", 1, when)
        first = self.sequencer.upcoming
        while self.timing.ps(self.timing.vsync(first)) < when:
            first += 1
        last = self.timing.ps(self.timing.vsync(first + DARKS - 1))
        self.write("ebaps_key", 0, last + 1)

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """See `Imager`. The trace shows the first `TRACED` frames that are delivered."""
        self._film = (scene, seed, kept)
        if self.board is not None:
            self.board.seed(seed)
        records: list[Record] = []
        traced: list[tuple[int, int]] = []
        while True:
            clock = self.sequencer.next_event()
            instant = self.timing.ps(clock)
            if instant > until:
                break
            self._until(instant)
            self.now = max(self.now, instant)
            shot = self.sequencer.step()
            if shot is None:
                continue
            if trace is not None and len(traced) < TRACED:
                records += self._records(shot)
                traced.append((shot.number, shot.exposure))
            yield self._frame(shot, instant)
        self._until(until)
        self.now = max(self.now, until)
        if trace is not None:
            records += drive_records(traced, self.timing)
            write_trace(trace, SIGNALS, sorted(records, key=lambda r: r[0]), top="ebaps")

    def _until(self, instant: int) -> None:
        """Applies the writes up to this time; a write at the time of a VSYNC precedes it."""
        while self._writes and self._writes[0][0] <= instant:
            _, _, register, value = heapq.heappop(self._writes)
            self.sequencer.registers.write(register, value)

    def _model(self, volts: int) -> EbapsPixels:
        if volts not in self._at:
            self._at[volts] = self.pixels.at(volts=float(volts))
        return self._at[volts]

    def _expose(self, shot: Shot) -> Read:
        """Computes the pixels of a frame whose last row was read, and stores them in the memory."""
        assert self._film is not None
        scene, seed, kept = self._film
        height, width = self.pixels.shape
        around = self.sequencer.around(shot)
        self._times = begin, end = row_times(self.timing, shot.number, around, height)
        self._late = int(np.count_nonzero(late_resets(self.timing, shot.number, around)[:height]))
        dark = np.zeros((height, width))
        light = dark if shot.closed else scene.lux_seconds(0, begin, end)
        seconds = (end - begin) / 1e12
        exposed = Exposed(light, seconds, np.zeros(height), 0, shot.number)
        self.memory.store(shot.region, self._model(shot.volts).convert(exposed, seed, kept))
        values = self.memory.read(shot.region)
        raw = int(values.sum(dtype=np.int64))
        self._raw_mean = raw / values.size
        shown = values
        subtracts, pedestal = self.sequencer.subtracts(), self.sequencer.pedestal()
        if not shot.key and subtracts:
            darks = [self.memory.read(n) for n in range(DARKS)]
            shown = subtract(values, mean_of_four(darks), pedestal)
        if not shot.key and self.board is not None:
            self.board.sends(Sent(shown, subtracts, pedestal))
        self._shown = shown
        return Read(raw, int(shown.sum(dtype=np.int64)), values.size)

    def _frame(self, shot: Shot, instant: int) -> Frame:
        assert self._shown is not None
        assert self._times is not None
        begin, end = self._times
        sequencer = self.sequencer
        status = sequencer.status
        state = {
            "exposure_ns": float(shot.exposure),
            "mean": float(self._shown.mean(dtype=np.float64)),
            "raw_mean": self._raw_mean,
            "settled": float(status & 1),
            "too_dark": float(status >> 1 & 1),
            "too_bright": float(status >> 2 & 1),
            "key": float(shot.key),
            "high_voltage": float(shot.volts),
            "dark_exposure_ns": float(sequencer.dark_exposure),
            "rows_reset_late": float(self._late),
            "next_exposure_ns": float(sequencer.registers.read("ebaps_exposure")),
        }
        return Frame(self._shown, self.pixels.bits, shot.number, begin, end, instant, state)

    def _records(self, shot: Shot) -> list[Record]:
        t, n = self.timing, shot.number
        fall = t.ps(t.vsync(n + 1))
        return [
            Record(t.ps(t.vsync(n)), "exposure_ns", shot.exposure),
            Record(t.ps(t.vsync(n)), "key", int(shot.key)),
            Record(fall, "read", 1),
            Record(t.ps(t.ready(n)), "read", 0),
        ]
