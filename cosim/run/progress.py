"""Progress of a run, for the user."""

from __future__ import annotations

from typing import Final, Protocol

_KEPT: Final = 64
"""Steps from which on every other one is forgotten."""


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
