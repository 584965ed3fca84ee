"""Output of commands: documents on standard output, progress and notes on standard error."""

from __future__ import annotations

import sys
import time
from typing import Annotated, Any

import typer

from cosim.run.progress import duration_text

__all__ = [
    "EVERY_S",
    "Json",
    "LineProgress",
    "SilentProgress",
    "TerminalProgress",
    "make_progress",
    "print_document",
    "size_option",
]

Json = Annotated[bool, typer.Option("--json", help="one JSON document on standard output")]


def print_document(document: Any) -> None:
    """Writes one JSON document to standard output."""
    from cosim.run.result import dumps

    sys.stdout.write(dumps(document) + "\n")


def size_option(text: str | None) -> tuple[int, int] | None:
    """(width, height) of a text WIDTHxHEIGHT; None for None. Raises InputError."""
    from cosim import InputError

    if text is None:
        return None
    width, x, height = text.lower().partition("x")
    if not (x and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise InputError(
            "--size", "WIDTHxHEIGHT such as 400x250", repr(text), "write it in this form"
        )
    if int(width) * int(height) > 10**9:
        raise InputError("--size", "at most 1e9 pixels", text, "check it")
    return int(width), int(height)


class SilentProgress:
    """A progress that prints notes only."""

    def start(self, what: str, total: int) -> None: ...

    def advance(self, done: int) -> None: ...

    def note(self, text: str) -> None:
        print(f"viform: {text}", file=sys.stderr)

    def close(self) -> None: ...


EVERY_S = 10.0
"""Minimum time between two lines of progress in a log, s."""


class LineProgress(SilentProgress):
    """A progress that prints a line every EVERY_S seconds, for logs. A shorter run prints none."""

    def __init__(self) -> None:
        self._last_line_at = time.monotonic()
        self._what, self._total, self._steps = "", 0, 0
        self._first: tuple[int, float] | None = None

    def start(self, what: str, total: int) -> None:
        self._what, self._total, self._first, self._steps = what, total, None, 0

    def advance(self, done: int) -> None:
        now, self._steps = time.monotonic(), self._steps + 1
        if self._steps <= 2:  # kernels are compiled in the first step
            self._first = done, now
        if now - self._last_line_at < EVERY_S or not self._total or self._first is None:
            return
        self._last_line_at = now
        before, began = self._first
        left = ""
        if before < done < self._total and 100 * (done - before) >= self._total:
            left = f", {duration_text((self._total - done) * (now - began) / (done - before))} left"
        self.note(f"{self._what}: {100 * done // self._total} %{left}")


class TerminalProgress(SilentProgress):
    """A progress bar on a terminal."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )

        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._progress.start()
        self._task: Any = None

    def start(self, what: str, total: int) -> None:
        self._task = self._progress.add_task(what, total=total)

    def advance(self, done: int) -> None:
        self._progress.update(self._task, completed=done)

    def note(self, text: str) -> None:
        self._progress.console.print(f"viform: {text}", markup=False, highlight=False)

    def close(self) -> None:
        self._progress.stop()


def make_progress() -> SilentProgress:
    """A bar if standard error is a terminal, else lines."""
    return TerminalProgress() if sys.stderr.isatty() else LineProgress()
