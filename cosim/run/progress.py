"""Progress of a run, for the user, and what a long recording will take, which is said at its
start.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import Final, Protocol

_KEPT: Final = 64
"""Steps from which on every other one is forgotten."""
_WATCHED_S: Final = 4.0
"""Time for which a recording is watched before it is extrapolated."""
_LEAST_S: Final = 10.0
"""Shorter recordings are not worth a line."""


class Progress(Protocol):
    """Receives the progress of a run, and notes."""

    def start(self, what: str, total: int) -> None:
        """Begins a stage of `total` steps; 0 for none, and before `tell` for an unknown number."""
        ...

    def advance(self, done: int) -> None:
        """Reports the number of completed steps of the stage."""
        ...

    def tell(self, what: str) -> None:
        """Changes the text of the stage."""
        ...

    def note(self, text: str) -> None:
        """Reports one line that the user must read."""
        ...


class QuietProgress:
    """A progress that shows nothing.

    Attributes:
        notes: the notes of the run.
    """

    def __init__(self) -> None:
        self.notes: list[str] = []

    def start(self, what: str, total: int) -> None: ...

    def advance(self, done: int) -> None: ...

    def tell(self, what: str) -> None: ...

    def note(self, text: str) -> None:
        self.notes.append(text)


class Pace:
    """The time that a stage still takes, from the later half of its steps.

    Kernels are compiled and queues fill in the first steps; they count in no estimate. There is
    none before the fourth step, which leaves the first two out.

    Args:
        total: steps of the stage.
    """

    def __init__(self, total: int) -> None:
        self._total = total
        self._seen: list[tuple[int, float]] = []

    def step(self, done: int, now: float) -> float | None:
        """Time left after `done` steps at the time `now`, s; None if it is unknown."""
        self._seen.append((done, now))
        if len(self._seen) < 4:
            return None
        before, began = self._seen[len(self._seen) // 2]
        if len(self._seen) >= _KEPT:
            del self._seen[1::2]
        if done <= before:
            return None
        return (self._total - done) * (now - began) / (done - before)


def duration_text(seconds: float) -> str:
    """Text of a time: 12 s, 3 min, 5.5 h."""
    for least, unit, name in ((7200, 3600, "h"), (120, 60, "min")):
        if seconds >= least:
            value = seconds / unit
            return f"{value:.0f} {name}" if value >= 10 else f"{value:.2g} {name}"
    return f"{max(seconds, 1):.0f} s"


def _size(folder: Path) -> int:
    """Bytes of the files below a folder; another thread may rename them meanwhile."""
    size = 0
    for place in folder.rglob("*"):
        with suppress(OSError):
            size += place.stat().st_size if place.is_file() else 0
    return size


class EstimatedProgress:
    """Passes progress on, and notes the time and the disk space of the whole recording as soon as
    its speed is known.

    Args:
        progress: receives everything.
        folder: folder into which the recording is written.
    """

    def __init__(self, progress: Progress, folder: Path) -> None:
        self._progress, self._folder = progress, folder
        self._what, self._total, self._said = "", 0, False
        self._began, self._pace, self._since = 0.0, Pace(0), 0.0

    def start(self, what: str, total: int) -> None:
        self._progress.start(what, total)
        self._what, self._total, self._said = what, total, False
        self._began, self._pace, self._since = time.monotonic(), Pace(total), 0.0

    def advance(self, done: int) -> None:
        self._progress.advance(done)
        now = time.monotonic()
        left = self._pace.step(done, now)
        if left is None or self._said:
            return
        self._since = self._since or now
        if now - self._since >= _WATCHED_S:
            self._said = True
            if self._total:
                self._say(now - self._began + left, done)

    def tell(self, what: str) -> None:
        self._progress.tell(what)

    def note(self, text: str) -> None:
        self._progress.note(text)

    def _say(self, seconds: float, done: int) -> None:
        if seconds < _LEAST_S:
            return
        size = _size(self._folder) * self._total // done
        unit, name = (1e9, "GB") if size >= 1e9 else (1e6, "MB")
        disk = f"{size / unit:.3g} {name} of disk"
        self.note(
            f"{self._what}: recording takes about {duration_text(seconds)} and {disk}; images and "
            "report follow"
        )
