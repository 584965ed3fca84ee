"""The clock of a camera whose ticks are locked to the panel: acquired before a run, held over it.

The loop runs on a model of its own before the chain: windows of a strip of the panel through the
same air and the same camera code, with the same clocks and timing noise, filmed at the phase and
with the length of tick that the loop's own corrections have brought about. The edges that result
are the chip's clock for the whole run. It is the loop that would run beside the chain: what it
reads, the spikes on the panel's cells, depends on the phase and the light, not on which bits a file
has, and it acts on the edges alone. So the run does not wait for it, and an interrupted run goes on
with the same edges. The rest of a strip's model is that of the pilots of a mode (`setup.pilot`);
the image does not shake in it, since a receiver follows it by the tags.

The panel idles before the transmission and shows the training again and again, so the loop is
locked when the recording begins. The few dark ticks that the recording begins with are not in the
model.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import PS
from cosim.compute.opencl import Device
from cosim.compute.table_cache import cached_value
from cosim.run.progress import Progress
from cosim.spikes.viform import WORD
from link.layout import TRAINING
from link.mode import Mode
from link.receiving.steering import PhaseDetector, PhaseLoop, centred
from link.receiving.synthesis import Levels
from link.setting import LEAD, TAIL, LinkSetting
from link.setup.locking.model import BEFORE, PhaseModel
from link.timing import Timing
from sensor.device.chips import ClockSteering
from sensor.latched.sampling import ClockMoves

SOURCES: Final = ("cosim", "sensor", "display", "link")
"""Packages that choose a mode, lock a clock and predict what arrives."""

INTERVAL: Final = 128
"""Ticks of the loop's interval. The spikes of its first WINDOW ticks give the correction that takes
effect at the next one's begin: at 40 kHz 2.5 ms remain for the decisions, the fit (1500 pixels of
some twenty ticks, in five passes of 10 ns each: 1.5 ms) and a write to a register by a serial line
(5 bytes at 115.2 kBd: .43 ms)."""
WINDOW: Final = 26
IDLE: Final = 48
"""Ticks of light that are read in an interval while the panel sends, and while it idles."""
_MOST: Final = 16
"""Intervals after which an acquisition is given up."""
_LOCKED: Final = 0.05
_TWICE: Final = 2
"""Largest phase, ticks, and number of intervals in a row with such a phase, from which the clock
counts as locked."""
_SHARP: Final = 0.05
_ROUGH: Final = 0.03
"""Largest standard error of a phase that is used, and error of the first one, ticks."""
_SLIP: Final = 0.5
"""Largest move of an edge from the panel's clock, ticks: with a larger one the lock is lost."""
_Measured = tuple[float, float] | None
"""A phase and its standard error, ticks; None if nothing could be measured."""
_IDLING: Final = -(1 << 60)
"""Time of a window before the recording, ps: long before any hidden span."""


def _unmeasured(phase: float, growth: float) -> None:
    """Measures nothing; see `Locking._interval`."""


@dataclass(frozen=True, eq=False)
class ClockLock:
    """How the clock was locked and held.

    Attributes:
        acquired: ticks from the loop's begin until the recording begins.
        phase: (ticks,) true phase of the panel's planes after the ticks, middle row, ticks.
        measured: (intervals,) what the loop measured at the intervals' begins, NaN for nothing.
        error: (intervals,) standard errors by chance.
        truth: (intervals,) true phase there.
    """

    acquired: int
    phase: npt.NDArray[np.float64]
    measured: npt.NDArray[np.float64]
    error: npt.NDArray[np.float64]
    truth: npt.NDArray[np.float64]

    @property
    def rms(self) -> float:
        """Root mean square of the phase, ticks."""
        return float(np.sqrt(np.mean(self.phase**2)))

    @property
    def most(self) -> float:
        """Largest phase, ticks."""
        return float(np.abs(self.phase).max())


class Locking:
    """The loop over a link's run; see above. `choose_and_lock` makes it.

    All but what it measures takes no time, so that a loop that `keeps` looks up the measurements of
    an earlier run of the same link. What it would have learnt by them it learns when it has to
    measure something new.

    Args:
        setting, mode: the link, with its own clocks.
        steering: steering of the camera's clock.
        detector: detector of the receiver.
        device: OpenCL device, None for numba.
        keeps: whether measurements are kept between runs.

    Attributes:
        setting: the link, with the clock of the camera that follows the panel's; its ticks become
            those of the loop by `hold`.
    """

    def __init__(
        self, setting: LinkSetting, mode: Mode, steering: ClockSteering, detector: str,
        device: Device | None, keeps: bool = False,
    ) -> None:  # fmt: skip
        self._made, self._keeps = (setting, mode, steering, detector, device), keeps
        self._known: deque[_Measured] | None = None
        self._found: list[_Measured] = []
        self._learnt: Locking | None = None
        self._learning = Lock()
        camera = setting.camera
        self._free, self._clock, self._panel = setting, camera.clock, setting.panel.clock
        self._model = PhaseModel(setting, mode, device)
        self._sees = PhaseDetector(self._model.layout, detector, self._model.registration)
        self._step, self._most = steering.step, steering.most(camera.clock)
        self._least = steering.least(camera.clock, camera.row_skew, camera.chip.height)
        count = INTERVAL * self._step / self._model.period
        self._loop = PhaseLoop(self._most * count, self._least * count)
        self._edges = [0]
        self._owed = 0.0
        self._levels: Levels | None = None
        self._slope = 0.0
        self._rows: list[tuple[float, float, float]] = []
        self._origin = 0
        self.setting = setting

    @property
    def _number(self) -> int:
        return (len(self._edges) - 1) // INTERVAL

    def _phases(self, edges: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """True phase of the planes in the middle row at edges, ticks."""
        period = PS / self._panel.hz
        late = (self._model.middle - edges) / period
        return np.asarray((late - np.floor(late + 0.5)) * period / self._model.period)

    def _truth(self) -> tuple[float, float]:
        """True phase at the begin of the current interval, ticks, and its growth, ticks a tick."""
        phase = float(self._phases(np.array([float(self._edges[-1])]))[0])
        drift = self._clock.hz / self._panel.hz - 1
        return phase, drift - self._loop.correction / INTERVAL

    def _interval(self, measure: Callable[[float, float], tuple[float, float] | None]) -> None:
        """Measures the phase of an interval, and goes through its ticks.

        measure: returns the phase and its standard error, for the true phase and its growth.
        """
        truth = self._truth()
        found = measure(*truth) if self._known is None else self._known.popleft()
        self._found.append(found)
        if found is not None and found[1] > _SHARP:
            found = None
        self._rows.append((truth[0], *(found or (np.nan, np.nan))))
        counts = self._counts()
        self._loop.step(*(found or (None,)))
        for tick in range(INTERVAL):
            length = self._clock.edge(len(self._edges)) - self._clock.edge(len(self._edges) - 1)
            self._edges.append(self._edges[-1] + length + self._step * int(counts[tick]))

    def _counts(self) -> npt.NDArray[np.int64]:
        """Counts by which each tick of the current interval is longer. What is less than a count is
        owed to the next interval."""
        whole = self._loop.correction * self._model.period / self._step + self._owed
        sums = np.floor(np.arange(INTERVAL + 1) * whole / INTERVAL + 0.5).astype(np.int64)
        self._owed = whole - float(sums[-1])
        return np.clip(np.diff(sums), -self._least, self._most)

    def _cold(self, phase: float, growth: float) -> tuple[float, float] | None:
        """Measures without any knowledge of the phase; see `_interval`."""
        model, ticks = self._model, self._model.mode.ticks
        more = max(-(-INTERVAL // ticks) - TRAINING, 0)
        shown = np.concatenate([self._sees.training, model.data(0, more)])
        recording = model.film(shown, phase, growth, 0, _IDLING)
        found = self._sees.acquire(recording, (BEFORE, BEFORE + len(shown) * ticks))
        if found is None:
            return None
        self._levels, self._slope = found.levels, found.timing.slope
        middle = TRAINING // 2
        start = float(found.timing.start(middle, self._model.rows / 2))
        return centred(start - BEFORE - middle * ticks), _ROUGH

    def _warm(self, phase: float, growth: float) -> tuple[float, float] | None:
        """Measures while the panel idles; see `_interval`."""
        assert self._levels is not None
        shown = self._sees.training[: -(-IDLE // self._model.mode.ticks)]
        recording = self._model.film(shown, phase, growth, self._number, _IDLING)
        found = self._sees.trained(recording, self._expected(), self._levels, len(shown))
        if found is None:
            return None
        delay, self._levels = found
        return self._loop.phase + delay.ticks, delay.error

    def _tracked(self, phase: float, growth: float) -> tuple[float, float] | None:
        """Measures while the panel sends; see `_interval`."""
        assert self._levels is not None
        number = self._number
        shown = self._model.data(number, -(-WINDOW // self._model.mode.ticks))
        since = self._edges[-1] - self._origin
        recording = self._model.film(shown, phase, growth, number, since)
        delay = self._sees.decided(recording, self._expected(), self._levels, len(shown))
        return None if delay is None else (self._loop.phase + delay.ticks, delay.error)

    def _expected(self) -> Timing:
        """Timing that the loop expects of a window in the current interval."""
        growth = self._loop.growth / INTERVAL
        return self._model.timing(self._loop.phase, growth, self._slope)

    def acquire(self) -> bool:
        """Locks the clock while the panel idles. Returns whether it is locked."""
        if not self._keeps:
            return self._acquired()
        locked: list[bool] = []

        def measure() -> tuple[_Measured, ...]:
            locked.append(self._acquired())
            return tuple(self._found)

        found = self._kept("acquired", (), measure)
        if not locked:
            self._known = deque(found)
            locked.append(self._acquired())
        self._found.clear()
        return locked[0]

    def _kept(
        self, what: str, more: tuple[Any, ...], measure: Callable[[], tuple[_Measured, ...]]
    ) -> tuple[_Measured, ...]:
        """What was measured, by an earlier run if there is one. more: arguments on which it depends
        beyond those of the loop."""
        *link, device = self._made
        arguments = what, *link, None if device is None else device.name, *more
        return cached_value("lock", arguments, SOURCES, tuple[_Measured, ...], measure)

    def _experienced(self) -> Locking:
        """The loop after an acquisition that it has measured itself."""
        if self._known is None:
            return self
        with self._learning:
            if self._learnt is None:
                learnt = Locking(*self._made)
                learnt._acquired()
                learnt._found.clear()
                self._learnt = learnt
            return self._learnt

    def _acquired(self) -> bool:
        """`acquire`, with measurements of its own or those that are known."""
        self._interval(self._cold)
        if np.isnan(self._rows[-1][1]):
            return False
        near = 0
        while near < _TWICE:
            if self._number >= _MOST:
                return False
            self._interval(self._warm)
            _, measured, _ = self._rows[-1]
            near = near + 1 if abs(measured) < _LOCKED else 0
        phase, growth = self._truth()
        if self._known is None:
            recording = self._model.film(self._sees.training, phase, growth, self._number, _IDLING)
            self._sees.learn(recording, self._expected())
        self._origin = self._edges[-1]
        self._rows.clear()
        # The panel's clock, as the mean clock of a camera that follows it, only keeps moves small.
        # The first plane whose light the middle row has LEAD ticks after the begin, to half a tick.
        after = self._origin + self._clock.edge(LEAD) - self._model.period / 2
        plane = -(-(round(after - self._model.middle)) // (PS / self._panel.hz))
        first = self._free.first_light + self._panel.edge(int(plane)) - self._origin
        camera = replace(self._free.camera, clock=self._panel)
        self.setting = replace(self._free, camera=camera, first_light=first, phase=phase % 1)
        return True

    def hold(
        self, setting: LinkSetting, planes: int, progress: Progress, measured: bool = True
    ) -> tuple[LinkSetting, ClockLock | None]:
        """A link with the ticks of the loop over its run, and how they were held; the link with the
        clocks that it had at first, and None, if the lock is lost. The loop stays as it was at the
        begin of the run, so that several threads may call this, again and again.

        Args:
            setting: link of `setting`; its hidden spans and its seeds may be changed.
            planes: number of planes of the transmission.
            progress: progress of the ticks.
            measured: whether the last interval is measured as well, which no tick of the run
                depends on.
        """
        if not (self._keeps and measured):  # calls differ in their seeds: none comes again
            return self._experienced()._copied()._held(setting, planes, progress, measured)
        held: list[tuple[LinkSetting, ClockLock | None]] = []

        def measure() -> tuple[_Measured, ...]:
            other = self._experienced()._copied()
            held.append(other._held(setting, planes, progress, measured))
            return tuple(other._found)

        found = self._kept("held", (setting, planes), measure)
        if not held:
            other = self._copied()
            other._known = deque(found)
            held.append(other._held(setting, planes, progress, measured))
        return held[0]

    def _copied(self) -> Locking:
        other = copy(self)
        other._found = []
        other._edges, other._rows = self._edges.copy(), self._rows.copy()
        other._loop, other._model = copy(self._loop), copy(self._model)
        other._sees = self._sees.copied()
        return other

    def _held(
        self, setting: LinkSetting, planes: int, progress: Progress, measured: bool
    ) -> tuple[LinkSetting, ClockLock | None]:
        """`hold`, after which the loop is at the end of the run."""
        self._model.take(setting)
        begin = len(self._edges) - 1
        cycles = self._panel.cycle_at(setting.first_light) + planes + 1 + TAIL
        ticks = cycles + WORD
        progress.start("ticks of the locked clock", ticks)
        while len(self._edges) - 1 < begin + ticks:
            last = len(self._edges) - 1 + INTERVAL >= begin + ticks
            self._interval(self._tracked if measured or not last else _unmeasured)
            progress.advance(min(len(self._edges) - 1 - begin, ticks))
        edges = np.array(self._edges[begin:], np.int64)
        mean = np.array([self._panel.edge(k) for k in range(len(edges))], np.int64)
        moves = ClockMoves(edges - edges[0] - mean)
        if moves.most > _SLIP * self._model.period:
            camera = replace(self._free.camera, seed=setting.camera.seed)
            return replace(self._free, aim=setting.aim, air=setting.air, camera=camera), None
        truth, phases, error = np.array(self._rows).T
        lock = ClockLock(
            begin, self._phases(edges[: cycles + 1].astype(np.float64)), phases, error, truth
        )
        return replace(setting, camera=setting.camera.changed(clock_moves=moves)), lock
