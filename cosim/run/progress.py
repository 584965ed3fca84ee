"""How far a run is, for the user."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Progress"]


class Progress(Protocol):
    """Receives how far a run is, and notes."""

    def start(self, what: str, total: int) -> None:
        """Begins a stage of `total` steps."""
        ...

    def advance(self, done: int) -> None:
        """Steps of the stage that are done."""
        ...

    def note(self, text: str) -> None:
        """One line that the user must read."""
        ...
