"""The receiver: from words of a camera to a file and a verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np

from cosim.compute.opencl import Device
from cosim.config.amounts import count
from cosim.run.progress import Progress, QuietProgress
from cosim.spikes.viform import Viform
from link.coding import BlockReader, Inbox
from link.detect.catalogue import DETECTORS
from link.layout import PERIOD, Layout
from link.receiving.acquiring import Acquired, Evidence, acquire, lit_spans
from link.receiving.diagnosis.failure import explain_failure
from link.receiving.diagnosis.loss import explain_loss
from link.receiving.received import Received
from link.receiving.recording import Recording
from link.receiving.session import Session
from link.receiving.tracking import joined
from link.receiving.tuned import Tuned
from link.timing import Registration
from link.verdict import Cause, Verdict

_WAIT: Final = 1024
"""Ticks after which a transmission is searched although the stream continues, and after which
stored ticks are decoded."""
_BREAKS, _SHORTEST = 8, 64
"""_BREAKS: interruptions that are followed at a time. _SHORTEST: ticks in which a sequence may be
detected."""
_DARK: Final = 8
"""Ticks without light after which the decoding begins anew: what was learned during them is
wrong."""
_JUMP: Final = 2.0
"""Ticks from which a shift of the sequence counts as a jump."""
_STORED: Final = 256
"""Ticks that stay stored if no transmission was detected."""
_SEARCHED: Final = 4
"""Largest number of ticks that are searched again after interruptions, per tick of the recording.
Eight interruptions at equal distances need four."""


class Receiver:
    """A receiver: the last stage of a chain.

    Streams up to _WAIT ticks are read as a whole by `finish`; of longer ones at most about twice as
    much is stored. A stream without a transmission, or with a part of one, is not an error: the
    verdict gives the cause.

    Args:
        shape: (height, width) of the camera.
        detector: its name.
        interleave: interleaving as used by the sender.
        inbox: makes the reader of the decoded groups for a layout; by default that of a file.
        device: OpenCL device of the words' decoder; None for the compiled form, with the same
            result.
        progress: progress, which is told the ticks that are done, and what takes long; None for
            nobody.
        tuned: what is known of the link from an earlier transmission; None for a search. A
            transmission that is not found by it is searched.

    Attributes:
        recording: the stored words.
        interrupted: tick after which the pilots' sequence jumped last, and by how many ticks; None
            without a jump.
        searches: number of searches after interruptions.
        searched: number of ticks that those searches covered.

    Raises:
        ValueError: for an unknown detector, and in `step` for blocks of another shape or out of
            order.
    """

    def __init__(
        self, shape: tuple[int, int], *, detector: str = "packed", interleave: bool = True,
        inbox: Callable[[Layout], BlockReader] | None = None, device: Device | None = None,
        progress: Progress | None = None, tuned: Tuned | None = None,
    ) -> None:  # fmt: skip
        if detector not in DETECTORS:
            raise ValueError(f"detector must be one of {', '.join(DETECTORS)}, not {detector}")
        self.recording = Recording(shape)
        self._detector, self._tuned = detector, tuned
        self._progress = progress or QuietProgress()
        self._make_inbox = inbox or (
            lambda layout: Inbox(layout, interleave=interleave, device=device)
        )
        self._evidence: Evidence | None = None
        self._acquired: Acquired | None = None
        self._session: Session | None = None
        self._unusable: Verdict | None = None
        self.interrupted: tuple[int, float] | None = None
        self.searches = self.searched = 0
        self._limited = False
        self._unbroken = False
        """Whether the last search found that the pilots go on without a jump."""
        self._begun: int | None = None

    def step(self, data: Viform, block: Any = None) -> None:
        """Takes the words of a block."""
        self.recording.add(data)
        if self._begun is None:
            self._begun = data.start
        waits = self._session.ready(self.recording) if self._session else self.recording.ticks
        if waits >= _WAIT:
            self._work()
            if self._session is None:
                self.recording.forget(self.recording.stop - _STORED)
                self._progress.advance(self.recording.stop)

    @property
    def session(self) -> Session | None:
        """The transmission that is being decoded; None until one is detected."""
        return self._session

    def finish(self) -> Received:
        """Decodes the remaining words and returns the result."""
        if self.recording.ticks:
            self._work()
        session = self._session
        if session is not None:
            session.inbox.flush()
        verdict = self._verdict()
        stop = self.recording.stop
        if session is None:
            e = self._evidence
            clocking = e.clocking if e is not None else None
            return Received(
                verdict, stop, mode=e.mode if e is not None else None,
                score=clocking.score if clocking is not None else 0.0,
            )  # fmt: skip
        acquired, inbox = self._acquired, session.inbox
        assert acquired is not None
        first = session.timing.first
        file = inbox.file
        return Received(
            verdict, stop,
            delivered=(file.data, file.name) if file is not None else None,
            mode=session.layout.mode,
            registration=Registration(
                session.refined.homography, joined(session.drift), session.refined.blur
            ),
            timing=session.timing, clock_error=session.pace.limit,
            first_light=round(first) if acquired.trained is not None else None,
            on=session.levels.on, background=session.levels.background,
            score=acquired.evidence.clocking.score if acquired.evidence.clocking else 0.0,
            instants=tuple(session.instants), delivered_tick=session.delivered_tick,
            frames_read=inbox.frames_read, frames_right=inbox.frames_right,
            frames_needed=inbox.frames_needed, codewords=inbox.codewords,
            codewords_wrong=inbox.codewords_wrong, bytes_corrected=inbox.bytes_corrected,
            rounds=inbox.rounds,
            cell_quality=session.grid(
                (session.quality / max(session.symbols, 1)).astype(np.float32)
            ),
            cell_errors=session.grid(inbox.cell_errors),
            soft=session.sample.soft, soft_at=session.sample.at,
            promise=session.promised / (session.symbols * session.layout.cells)
            if session.symbols
            else None,
            packed=session.packed,
            watched=session.watcher.result(),
        )  # fmt: skip

    def _work(self) -> None:
        """Searches for a transmission, or continues with one."""
        if self._session is None:
            acquired = None if self._tuned is None else self._tuned.found(self.recording)
            if acquired is not None:
                evidence = acquired.evidence
            else:
                self._tuned = None
                evidence, acquired = acquire(self.recording)
            if self._evidence is None or _further(evidence) >= _further(self._evidence):
                self._evidence = evidence
            if acquired is None:
                return
            self._begin(acquired, self._tuned)
        if self._session is not None:
            self._session.advance(self.recording)
            self._resume()

    def _resume(self) -> None:
        """Searches for the pilots again after an interruption: lost words, or a restart of the
        panel.

        The search begins after the last correct symbols. Frames received so far are preserved. All
        searches together cover at most _SEARCHED times the recording, so that a damaged recording
        takes a limited multiple of the time of a sound one.
        """
        for _ in range(_BREAKS):
            old = self._session
            assert old is not None
            if old.inbox.file is not None or not old.lost or self.recording.ticks < _SHORTEST:
                return
            clocking = self._acquired.evidence.clocking if self._acquired is not None else None
            until = old.sound_until
            if clocking is not None and clocking.broken:
                until = max(until, clocking.lit[1])
            self.recording.forget(int(until))
            if self.searched + self.recording.ticks > _SEARCHED * self._received:
                self._limited = True
                return
            self.searches += 1
            self.searched += self.recording.ticks
            gaps = len(self.recording.gaps)
            _, acquired = acquire(self.recording)
            if acquired is None or acquired.layout.mode != old.layout.mode:
                return
            jump = self._jump(old, acquired, until)
            filled = len(self.recording.gaps) > gaps
            if jump is None and not filled and not self._was_dark(old):
                self._unbroken = True
                return
            self._unbroken = False
            self.interrupted = jump or self.interrupted
            acquired = acquired.numbered_as(old.timing)
            self._acquired = acquired
            session = self._session_of(acquired, old.inbox)
            session.go_on_from(old)
            self._session = session
            session.advance(self.recording)

    def _was_dark(self, old: Session) -> bool:
        """Whether the panel was dark for _DARK of the stored ticks, and lit after them."""
        dark = self.recording.first
        for low, high in lit_spans(self.recording, old.layout, old.refined.homography):
            if low > dark + _DARK:
                return True
            dark = high
        return False

    @property
    def _received(self) -> int:
        """Number of ticks of the recording so far."""
        return self.recording.stop - (self._begun or 0)

    def _jump(self, old: Session, new: Acquired, until: float) -> tuple[int, float] | None:
        """(tick, ticks) at which and by which the sequence jumps; None without a jump."""
        turn = PERIOD * old.timing.period
        row = self.recording.shape[0] / 2
        symbol = round((until - new.timing.first) / new.timing.period)
        at = float(new.timing.start(symbol, row))
        delay = at - float(old.timing.start(symbol, row))
        delay -= turn * round(delay / turn)
        return (int(until), delay) if abs(delay) > _JUMP else None

    def _begin(self, acquired: Acquired, tuned: Tuned | None) -> None:
        try:
            inbox = self._make_inbox(acquired.layout)
        except ValueError as exc:
            self._unusable = Verdict(Cause.TOO_SMALL, f"the panel's mode carries no data: {exc}")
            return
        self._acquired = acquired
        self._session = self._session_of(acquired, inbox, tuned)

    def _session_of(
        self, acquired: Acquired, inbox: BlockReader, tuned: Tuned | None = None
    ) -> Session:
        session = Session(acquired, self._detector, inbox, self.recording.shape, tuned)
        session.progress = self._progress
        return session

    def _verdict(self) -> Verdict:
        session = self._session
        if session is None:
            return self._unusable or explain_failure(self.recording, self._evidence)
        inbox = session.inbox
        if inbox.file is None:
            loss = explain_loss(
                session,
                self.recording.stop,
                self.interrupted or self._gap(),
                self._unbroken,
            )
            return replace(loss, text=loss.text + self._search_text())
        return Verdict(
            Cause.NONE,
            f"{count(len(inbox.file.data))} bytes in {count(inbox.frames_right)} frames of "
            f"{count(inbox.frames_read)}, {count(inbox.bytes_corrected)} bytes mended, whole at "
            f"tick {count(session.delivered_tick)}",
        )

    def _gap(self) -> tuple[int, float] | None:
        """Last gap that was filled, as `interrupted`; None without one."""
        gaps = self.recording.gaps
        return (gaps[-1].tick, float(-gaps[-1].count)) if gaps else None

    def _search_text(self) -> str:
        """What was searched after interruptions, for the verdict."""
        if not self.searches and not self._limited:
            return ""
        times = "once" if self.searches == 1 else f"{self.searches} times"
        limit = f"the limit of {_SEARCHED} times the recording's {self._received}"
        return f" (the pilots were searched again {times}, in {self.searched} ticks" + (
            f": {limit})" if self._limited else ")"
        )


def _further(evidence: Evidence) -> int:
    """Number of steps that succeeded."""
    return (
        len(evidence.search.tags) + (evidence.refined is not None) + (evidence.lit is not None)
        + (evidence.clocking is not None)
    )  # fmt: skip
