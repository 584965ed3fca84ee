"""Progress of a run, for the user."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Progress"]


class Progress(Protocol):
    """Receives the progress of a run, and notes."""

    def start(self, what: str, total: int) -> None:
        """Begins a stage of `total` steps."""
        ...

    def advance(self, done: int) -> None:
        """Reports the number of completed steps of the stage."""
        ...

    def note(self, text: str) -> None:
        """Reports one line that the user must read."""
        ...
