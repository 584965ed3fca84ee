"""The whole adaptive-exposure sensor: light in, frames out, controlled by its registers; and the
latency from a step of the light to the new exposure, measured on it.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.frames import Frame
from imagers.adaptive.device.controller import Controller
from imagers.adaptive.device.decision import Search, gather
from imagers.adaptive.device.registers import DEFAULT_SHAPE
from imagers.adaptive.device.signals import Coupling, row_kicks, signal_list, signals_of
from imagers.adaptive.device.timing import FRAME_RATE, FrameTiming, Timing
from imagers.adaptive.pixels import AdaptivePixels, CmosExposed
from imagers.common.registers import register_of, write_instant
from imagers.common.scenery import Course, Scenery, Still
from imagers.common.trace import trace_ending, write_trace
from rtl_model.registers.table import Register
from sensor.frame_pixels import Exposed

TRACED = 3
"""Number of frames in a trace."""


class AdaptiveExposure:
    """The adaptive-exposure sensor; see `Imager`.

    A write to an exposure register takes effect at the next decision, which sets the exposure of
    the frame after the next. A write to a window register takes effect at the start of the next
    frame.

    Args:
        pixels: pixel array; None for one of the default shape.
        timing: timing of the sequencer; None derives it from `frame_rate`.
        frame_rate: frame rate without `timing`, Hz.
        coupling: coupling of switching logic onto the pixels; None for none, and Gray code.

    Attributes:
        timings: instants, with a coupling, of all frames filmed and of the one after them.
    """

    name = "adaptive-exposure"

    def __init__(
        self, pixels: AdaptivePixels | None = None, timing: Timing | None = None,
        frame_rate: float = FRAME_RATE, coupling: Coupling | None = None,
    ) -> None:  # fmt: skip
        self.pixels = pixels or AdaptivePixels(DEFAULT_SHAPE)
        self.timing = timing or Timing.of(*self.pixels.shape, frame_rate)
        if (self.timing.rows, self.timing.columns) != self.pixels.shape:
            raise ValueError(f"timing must be for {self.pixels.shape} pixels, not {self.timing}")
        self.controller = Controller(self.timing)
        self.coupling, self.timings = coupling, list[FrameTiming]()
        self._waiting: list[tuple[int, int, str, int]] = []
        self._written, self._now = 0, 0

    @property
    def registers(self) -> tuple[Register, ...]:
        """Its register table, with the common head."""
        return self.controller.registers.design.registers

    @property
    def now(self) -> int:
        """Present instant, ps."""
        return self._now

    def write(self, register: str, value: int, at: int | None = None) -> None:
        """See `Imager`; the prefix `adaptive_` of a name may be omitted."""
        entry = register_of(self.controller.registers, register)
        when = write_instant(entry, register, value, at, self._now)
        insort(self._waiting, (when, self._written, entry.name, value))
        self._written += 1
        self._apply(self._now)

    def read(self, register: str) -> int:
        """See `Imager`. Raises InputError for an unknown register."""
        registers = self.controller.registers
        return registers.read(register_of(registers, register).name)

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """See `Imager`. The trace holds the first frames of this call with clock resolution."""
        if scene.shape != self.pixels.shape:
            raise ValueError(f"scene must be {self.pixels.shape}, not {scene.shape}")
        if trace is not None:
            trace_ending(trace)
        edge, core = self.timing.clock.edge, self.controller
        core.begin()
        traced: list[FrameTiming] = []
        while True:
            timing = core.frame
            ready = edge(timing.start + self.timing.deciding)
            if ready > until:
                break
            if core.opened is None:
                self._apply(edge(timing.start))
                core.open()
            counting = core.opened
            assert counting is not None
            begin, end = self._times(timing)
            light = scene.lux_seconds(0, begin, end)
            seconds, waiting = (end - begin) / PS, np.zeros(len(end))
            exposed = Exposed(light, seconds, waiting, 0, timing.number)
            if self.coupling is not None:
                self.timings[timing.number :] = [timing, core.following]
                kicks = row_kicks(self.timing, self.timings, timing.number, self.coupling)
                exposed = CmosExposed(light, seconds, waiting, 0, timing.number, kicks)
            values, saturated = self.pixels.digitise(exposed, seed, kept)
            statistics = gather(values, saturated, counting.window, whole_scan=counting.whole_scan)
            self._apply(ready)
            state = core.close(statistics)
            self._now = ready
            if trace is not None and len(traced) < TRACED:
                traced.append(timing)
                if len(traced) == TRACED:
                    self._write_trace(trace, traced)
            yield Frame(values, self.pixels.bits, timing.number, begin, end, ready, state)
        if trace is not None and 0 < len(traced) < TRACED:
            self._write_trace(trace, traced)
        self._apply(until)
        self._now = max(self._now, until)

    def _apply(self, until: int) -> None:
        """Executes the writes that are due until an instant. A frame that has begun by then uses
        the window registers as they were at its start."""
        start = self.timing.clock.edge(self.controller.frame.start) if self._running else until + 1
        while self._waiting and self._waiting[0][0] <= until:
            if self.controller.opened is None and start < self._waiting[0][0]:
                self.controller.open()
            _, _, register, value = self._waiting.pop(0)
            self.controller.registers.write(register, value)
        if self.controller.opened is None and start <= until:
            self.controller.open()

    @property
    def _running(self) -> bool:
        return self.controller.multiplier > 0

    def _times(self, timing: FrameTiming) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        edge, rows = self.timing.clock.edge, range(self.timing.rows)
        return (
            np.array([edge(timing.reset(row)) for row in rows], np.int64),
            np.array([edge(timing.sample(row)) for row in rows], np.int64),
        )

    def _write_trace(self, path: Path, frames: list[FrameTiming]) -> None:
        edge, code = self.timing.clock.edge, self.coupling.code if self.coupling else "gray"
        records = ((edge(clock), name, value) for clock, name, value in
                   signals_of(self.timing, frames, code))  # fmt: skip
        write_trace(path, signal_list(self.timing, code), records, top="adaptive_exposure")


class Latency(NamedTuple):
    """Frames and time after a step of the light.

    Attributes:
        changed: last frame N with a row that was exposed before the step.
        recorded: first later frame with a new exposure.
        settled: first frame from which the exposure does not change.
        seconds: time from the step to the sample of row 0 of frame `settled`, s.
    """

    changed: int
    recorded: int
    settled: int
    seconds: float


def latency(
    timing: Timing,
    change: int,
    before: float,
    after: float,
    *,
    multiplier: int,
    search: Search = Search.PART,
    frames: int = 12,
) -> Latency:
    """Steps the light on all pixels and measures the response, without noise.

    Args:
        timing: timing of the sensor.
        change: instant of the step, ps.
        before, after: illuminance before and after it, lux.
        multiplier: settled exposure under `before`, in units of T. It is set by the user; the first
            decision is automatic.
        search: how a saturating exposure is shortened.
        frames: number of frames that are filmed after the step, at least.

    Raises RuntimeError if the exposure does not change.
    """
    pixels = AdaptivePixels((timing.rows, timing.columns))
    imager = AdaptiveExposure(pixels, timing)
    imager.write("adaptive_automatic", 0)
    imager.write("adaptive_user", multiplier)
    imager.write("adaptive_search", int(search))
    imager.write("adaptive_automatic", 1, at=1)
    plane = np.ones(pixels.shape)
    course = Course(((change, before), (change, after)))
    until = change + frames * timing.clock.edge(timing.period(multiplier * 20))
    taken = list(imager.film(Still(plane, course), until, seed=0, kept=frozenset()))
    changed = max((f.number for f in taken if f.begin[0] < change), default=0)
    steps = [f.state["multiplier"] for f in taken]
    if steps[0] != multiplier or steps[-1] == steps[changed]:
        raise RuntimeError(f"the exposure does not change: {steps}")
    recorded = next(n for n in range(changed, len(steps)) if steps[n] != multiplier)
    last = max(n for n in range(1, len(steps)) if steps[n] != steps[n - 1])
    return Latency(changed, recorded, last, (int(taken[last].end[0]) - change) / PS)
