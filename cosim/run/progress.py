"""Progress of a run, for the user."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Progress", "QuietProgress", "duration_text"]


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


def duration_text(seconds: float) -> str:
    """Text of a time: 12 s, 3 min, 5.5 h."""
    for least, unit, name in ((7200, 3600, "h"), (120, 60, "min")):
        if seconds >= least:
            value = seconds / unit
            return f"{value:.0f} {name}" if value >= 10 else f"{value:.2g} {name}"
    return f"{max(seconds, 1):.0f} s"
