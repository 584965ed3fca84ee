"""Decoding of an acquired transmission, group by group, as its words arrive.

Sections of the recording are decoded one after another. Within a section the detector is the same
and learns from its own decisions as the phase of the symbols moves within the tick. From one
section to the next, the image's drift and the symbols' timing are measured again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from cosim.run.progress import Progress, QuietProgress
from link.detect.calibration import scaling_factor
from link.detect.catalogue import make_detector
from link.detect.detector import Detector
from link.detect.joint import Joint
from link.layout import TRAINING, is_closing, training
from link.receiving.acquiring import Acquired, lit_spans
from link.receiving.ahead import Ahead
from link.receiving.gaps import learn_known, mended
from link.receiving.phasing import followed_delay
from link.receiving.received import Instant, SoftSample, Watcher
from link.receiving.recording import Recording
from link.receiving.tally import decide, tally
from link.receiving.tracking import drift_by_tags
from link.receiving.tuned import ClassesMet, Tuned
from link.timing import Registration, Timing

if TYPE_CHECKING:
    from link.coding import BlockReader

Floats = npt.NDArray[np.float64]
_CHUNK: Final = 40
"""Approximate number of symbols decoded at a time."""
_KNOWN: Final = 48
"""Symbols that a detector learns from."""
_LONGEST: Final = 4096
"""Stored ticks from which a transmission whose frames stay wrong is followed by pilots alone."""
_CHECK: Final = 128.0
"""Ticks after which the timing is measured again."""
_SHIFTED: Final = 0.01
"""Change of the timing after which the detector learns again, ticks. With .03, a timing .023 off
brought the symbols to a class of phase that the detector had not learned: ten times the errors."""
_MOVED: Final = 1 / 16
"""Change of the phase after which the detector learns again, ticks."""
_FRESH: Final = 1 / 64
"""Change of the phase after which a new detector is made: one that learns on keeps what it has
learned at other phases of the class. At 400 ppm, where a class lasts 312 ticks, that costs .004 bit
while the information is above .94 bit, .12 at .77, which it falls to without mended decisions."""
_SLACK: Final = 4.0
"""Ticks after the tags go dark that may belong to the last symbol."""
_CUT: Final = 0.1
"""Ticks of a group that the recording may lack, as the timing is not known more accurately."""
_STORED: Final = 2048
"""Number of symbols whose decisions are stored."""
_SOUND: Final = 0.5
"""Share of a chunk's frames that must be correct for its decisions to be used as training."""


@dataclass(frozen=True, eq=False)
class Section:
    """A part of the recording that is decoded with one measurement of the image's motion.

    Attributes:
        registration: registration of the panel, with the motion.
        detector: the first one, which has learned.
        last: tick until which symbols can be decoded.
    """

    registration: Registration
    detector: Detector
    last: float


class Session:
    """Decoding of one transmission.

    Attributes:
        layout, refined, pace, levels: layout, refined registration, pace and levels of the
            acquisition, pace and refined updated.
        detector_name: name of the detector.
        inbox: receives the groups.
        rows: number of rows of the camera.
        trained: symbols of the training in the recording.
        drift: displacement of the image, a part for each section.
        instants: decoded groups.
        delivered_tick: tick at which the file was whole; None before.
        packed: decisions of the last symbols, packed bits.
        promised: number of wrong decisions that all soft values predict.
        sample: Sample of the soft values.
        watcher: soft values of some cells over the symbols.
        quality: (cells,) sum of the magnitudes of the soft values.
        symbols: number of decoded symbols.
        lit_stop: tick at which the panel goes dark.
        sound_until: tick until which the decisions are known to be correct.
        lost: whether the last frames were wrong.
        progress: progress, which is told what takes long, and the tick that is decoded.
        dark: longest time for which the panel was dark between two groups, ticks.
        learned: what it knows after the training, for another receiver; None if that is no use.

    Args:
        tuned: what an earlier receiver knew; None for a detector that learns.
    """

    def __init__(
        self, acquired: Acquired, detector: str, inbox: BlockReader, shape: tuple[int, int],
        tuned: Tuned | None = None,
    ) -> None:  # fmt: skip
        self.layout, self.refined = acquired.layout, acquired.refined
        self.pace, self.levels = acquired.pace, acquired.levels
        self.detector_name, self.inbox, self.rows = detector, inbox, shape[0]
        self.progress: Progress = QuietProgress()
        self.trained, self.lit_stop = acquired.trained, acquired.lit[1]
        self.drift: list[Floats] = []
        self.instants: list[Instant] = []
        self.delivered_tick: int | None = None
        self.packed: dict[int, npt.NDArray[np.uint8]] = {}
        self.promised = 0.0
        self.sample = SoftSample()
        self.watcher = Watcher(self.layout)
        self.quality = np.zeros(self.layout.cells)
        self.symbols = 0
        self._known: tuple[int, npt.NDArray[np.bool_]] | None = None
        if acquired.trained is not None:
            low, high = acquired.trained
            self._known = low, training(self.layout)[low:high]
        self._confidence: float | None = None
        """Factor on soft values, learned from the training; None before."""
        self._next: int | None = None
        self._ahead = Ahead()
        self._checked = self.pace.at
        self._learned = 0.0
        self._made = 0.0
        """Phase for which the detector was made."""
        self._acquired, self._tuned, self.learned = acquired, tuned, tuned
        self._met: ClassesMet | None = None
        """What the detector has learned; None without one."""
        self.sound_until = float(self.timing.start(0, self.rows / 2))
        self.lost = False
        self.dark = 0

    def go_on_from(self, old: Session) -> None:
        """Takes over the results of an earlier session of the same transmission."""
        self.drift, self.instants = old.drift, old.instants
        self.promised, self.sample = old.promised, old.sample
        self.quality, self.symbols, self.packed = old.quality, old.symbols, old.packed
        self.watcher, self.dark = old.watcher, old.dark

    def symbol_ends(self, symbol: int) -> float:
        """Tick by which all rows have received all of a symbol."""
        return float(np.max(self.timing.start(symbol + 1, np.array([0, self.rows]))))

    def _begins(self, symbol: int) -> float:
        return float(np.min(self.timing.start(symbol, np.array([0, self.rows]))))

    def _first_group(self, tick: int) -> int:
        """First group that begins at or after a tick."""
        symbol = (tick - self.timing.first + max(0.0, -self.timing.slope)) / self.timing.period
        return max(0, int(np.ceil((symbol - TRAINING) / self.layout.group)))

    @property
    def timing(self) -> Timing:
        """Current estimate of the timing."""
        return self.pace.timing

    def ready(self, recording: Recording) -> float:
        """Number of stored ticks that have not been decoded."""
        if self._next is None:
            return float(recording.ticks)
        return recording.stop - self._begins(TRAINING + self._next * self.layout.group)

    @property
    def decoded_until(self) -> float:
        """Tick before which every whole group has been decoded."""
        if self._next is None:
            return -math.inf
        return self.symbol_ends(TRAINING + self._next * self.layout.group - 1)

    def advance(self, recording: Recording) -> None:
        """Decodes the groups that are whole in a recording, and drops words that are not needed."""
        section = self.begin(recording)
        if section is not None:
            self.decode(recording, section)

    def begin(self, recording: Recording) -> Section | None:
        """Measures the image's motion in a recording and makes a detector for it, which has
        learned. Returns None, with the words dropped, if nothing in it can be decoded."""
        spans: list[tuple[int, int]] = []
        if not self.inbox.over:
            spans = lit_spans(recording, self.layout, self.refined.homography)
            # Before the first group the panel need not have been on.
            begun = [] if self._next is None else [(0, recording.first)]
            for (_, off), (on, _) in pairwise([*begun, *spans]):
                self.dark = max(self.dark, on - off)
        if not spans:
            recording.forget(recording.stop)
            return None
        lit = spans[0][0], spans[-1][1]
        self.lit_stop = lit[1]
        drift = drift_by_tags(recording, self.layout, self.refined, lit)
        self.drift.append(drift)
        registration = Registration(self.refined.homography, drift, self.refined.blur)
        if self._next is None:
            self._next = self._first_group(max(lit[0], recording.first))
        # Rows end one after another, and a group of which half is missing does no harm.
        slack = min(_SLACK, self.layout.group * self.layout.mode.ticks / 2)
        last = min(lit[1] + slack, recording.stop + _CUT)
        try:
            detector = self._detector(recording, registration, lit)
        except ValueError:  # the stored pilots are too few to learn from
            self.lost = True
            recording.forget(recording.stop - _LONGEST // 2)
            return None
        return Section(registration, detector, last)

    def decode(self, recording: Recording, section: Section) -> None:
        """Decodes the groups of a section of `begin`, and drops words that are not needed."""
        with self._ahead.running():
            self._decode(recording, section)
        if self.inbox.over:
            recording.forget(recording.stop)
        elif recording.ticks > _LONGEST and self.lost:
            self._known = None
            recording.forget(recording.stop - _LONGEST // 2)
        elif self._known is not None:
            recording.forget(int(self._begins(self._known[0])) - 2 * self.layout.mode.ticks - 8)

    def _groups_until(self, first: int, last: float) -> int:
        """Number of groups from a symbol on that end until a tick, up to _CHUNK."""
        group, count = self.layout.group, 0
        many = max(1, _CHUNK // group)
        while count < many and self.symbol_ends(first + (count + 1) * group - 1) <= last:
            count += 1
        return count

    def _decode(self, recording: Recording, section: Section) -> None:
        """Decodes the groups of a section."""
        assert self._next is not None
        registration, detector, last = section.registration, section.detector, section.last
        group = self.layout.group
        while True:
            first = TRAINING + self._next * group
            count = self._groups_until(first, last)
            if not count:
                return
            number = self._next
            before = self.inbox.frames_read, self.inbox.frames_right
            # After wrong frames the timing is in doubt, and such laws would delay a new search.
            if self._known is not None and self._met is not None and not self.lost:
                if not self._met.has(first, count * group):
                    self._ahead.stop()
                self._met.learn_ahead(recording, detector, self._known, first, count * group)
            soft = self._ahead.soft(recording, detector, first, count * group)
            soft = mended(soft, detector, recording, self.timing, first, self.inbox)
            following = first + count * group
            more = self._groups_until(following, last) * group
            if more and self._stays(first, count * group, more):
                self._ahead.start(recording, detector, following, more)
            if is_closing(self.layout, soft[-group:] > 0):
                count -= 1
                soft = soft[:-group]
                if not count:
                    return
            decided = decide(soft, 1.0 if self._confidence is None else self._confidence)
            self._deliver(first, soft, decided)
            self._next += count
            self.progress.advance(int(min(self.decoded_until, recording.stop)))
            if self.inbox.over:
                return
            arrived, right = (
                a - b for a, b in zip((self.inbox.frames_read, self.inbox.frames_right), before,
                                      strict=True)
            )  # fmt: skip
            if arrived == 0 or right >= _SOUND * arrived:
                part = self.inbox.mend(number, decided)[-_KNOWN:]
                self._known = first + len(decided) - len(part), part
                if arrived:
                    self.lost, self.sound_until = False, self.symbol_ends(first + count * group - 1)
                detector = self._follow(recording, registration, detector)
            else:
                self.lost = True

    def _stays(self, first: int, count: int, more: int) -> bool:
        """Whether the detector will probably not learn between `count` symbols and `more`."""
        if self._met is None:
            return False
        stop = first + count
        begin = stop - min(count, _KNOWN)
        return self._met.has(stop, more) and not self._must_learn(self._phase(stop), begin, stop)

    def _must_learn(self, phase: float, begin: int, stop: int) -> bool:
        """Whether a detector has to be made for this phase, or to learn from symbols `begin` to
        `stop`."""
        assert self._met is not None
        moved = abs(phase - self._made) > _FRESH or abs(phase - self._learned) > _MOVED
        return moved or not self._met.has(begin, stop - begin)

    def _phase(self, symbol: int) -> float:
        """How far symbols have moved within the tick until a symbol, ticks."""
        return (self.timing.period - round(self.timing.period)) * symbol

    def _detector(self, recording: Recording, registration: Registration, lit: Any) -> Any:
        tuned, self._tuned = self._tuned, None
        moved = None if tuned is None else tuned.at(registration, self.timing)
        if tuned is not None and moved is not None and self._known is not None:
            self._confidence = tuned.confidence
            self._settle(moved, self._known[0], len(self._known[1]))
            return moved
        detector = make_detector(self.detector_name, self.layout, registration, self.timing)
        if self._known is not None:
            begin, known = self._known
            count = len(known)
            self.progress.tell(f"receiver: {self.detector_name} learns from {count} symbols")
            learn_known(detector, recording, self.timing, known, begin)
            if self._confidence is None and begin < TRAINING:
                soft = detector.soft(recording.words, recording.first, begin, len(known))
                self._confidence = scaling_factor(soft, known)
            self.progress.tell(f"receiver: {self.detector_name}")
        else:
            begin = int(np.ceil((max(lit[0], recording.first) - self.timing.first)
                                / self.timing.period)) + 1  # fmt: skip
            stop = int((min(lit[1], recording.stop) - self.timing.first) / self.timing.period) - 1
            count = max(stop - begin, 1)
            detector.learn_pilots(recording.words, recording.first, begin, count)
        met = self._settle(detector, begin, count)
        if isinstance(detector, Joint) and begin < TRAINING and self._known is not None:
            self.learned = Tuned(self._acquired, detector, met, self._confidence)
        return detector

    def _settle(self, detector: Detector, begin: int, count: int) -> ClassesMet:
        """Begins to follow the phase with a detector that has learned from `count` symbols."""
        self._learned = 0.0
        self._made = self._phase(begin + count)
        self._met = ClassesMet(detector, self.timing, self.rows, begin, count)
        return self._met

    def _follow(self, recording: Recording, registration: Registration, detector: Any) -> Any:
        """Detector for the next chunk, after one whose decisions are correct."""
        assert self._known is not None and self._met is not None
        begin, decided = self._known
        now = float(self.timing.start(begin + len(decided) / 2, self.rows / 2))
        phase, whole = self._phase(begin + len(decided)), (recording.first, recording.stop)
        if now - self._checked >= _CHECK:
            self._checked = now
            delay = followed_delay(
                recording, self.layout, registration, self.timing, self.levels, self._known
            )
            if delay is not None:
                self.pace = self.pace.measured(now, delay)
                middle = begin + len(decided) / 2, self.rows / 2
                if abs(self.timing.start(*middle) - self._met.timing.start(*middle)) > _SHIFTED:
                    return self._detector(recording, registration, whole)
        if abs(phase - self._made) > _FRESH:
            return self._detector(recording, registration, whole)
        if self._must_learn(phase, begin, begin + len(decided)):
            self._ahead.stop()
            learn_known(detector, recording, self.timing, decided, begin)
            self._learned = phase
            self._met.add(begin, len(decided))
        return detector

    def _deliver(
        self, first: int, soft: npt.NDArray[np.float32], decided: npt.NDArray[np.bool_]
    ) -> None:
        group = self.layout.group
        for n in range(len(soft) // group):
            number = (first - TRAINING) // group + n
            before = self.inbox.frames_read
            right = self.inbox.put(number, soft[n * group : (n + 1) * group])
            if self.inbox.over:
                soft = soft[: n * group]
                break
            tick = int(np.ceil(self.symbol_ends(first + (n + 1) * group - 1) - _CUT))
            self.instants.append(Instant(number, tick, right, self.inbox.frames_read - before))
            if self.inbox.file is not None and self.delivered_tick is None:
                self.delivered_tick = tick
        self.promised += tally(soft, self.quality)
        for n, row in enumerate(np.packbits(decided[: len(soft)], axis=1)):
            self.packed[first + n] = row
        self.symbols += len(soft)
        self.watcher.add(first, soft)
        for symbol in list(self.packed)[: max(len(self.packed) - _STORED, 0)]:
            del self.packed[symbol]
        self.sample.add(first, soft)

    def grid(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Values of data cells on the panel, (rows, columns)."""
        out = np.zeros(self.layout.shape, values.dtype)
        out.ravel()[self.layout.data] = values
        return out
