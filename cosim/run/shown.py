"""Progress that a user sees, on standard error: a bar on a terminal, lines in a log."""

from __future__ import annotations

import sys
import threading
import time
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from cosim.compute.compiling import compiled_within
from cosim.errors import one_line, say
from cosim.run.progress import Pace, QuietProgress, duration_text

EVERY_S = 10.0
"""Minimum time between two lines of progress in a log, s."""


class SilentProgress:
    """A progress that prints notes only."""

    def start(self, what: str, total: int) -> None: ...

    def advance(self, done: int) -> None: ...

    def tell(self, what: str) -> None: ...

    def note(self, text: str) -> None:
        say(text)

    def close(self) -> None: ...


class LineProgress(SilentProgress):
    """A progress that prints a line every EVERY_S seconds, for logs. A shorter run prints none.

    A thread prints one as well if a step takes longer than that: kernels may be compiled in it.
    """

    def __init__(self) -> None:
        self._began = self._last_line_at = time.monotonic()
        self._what, self._total, self._pace, self._told = "", 0, Pace(0), False
        self._done, self._stepped_at = 0, self._began
        self._closed = threading.Event()
        # The thread holds no progress that was given up without a close.
        watching = weakref.ref(self), self._closed
        threading.Thread(target=_watch, args=watching, name="viform-progress", daemon=True).start()

    def start(self, what: str, total: int) -> None:
        self._what, self._total, self._pace, self._told = what, total, Pace(total), False
        self._done, self._stepped_at = 0, time.monotonic()

    def advance(self, done: int) -> None:
        now = time.monotonic()
        if done != self._done:
            self._done, self._stepped_at = done, now
        seconds = self._pace.step(done, now)
        known = self._total or self._told  # a text that changes says something by itself
        if now - self._last_line_at < EVERY_S or not known:
            return
        if not self._total:
            self.note(self._what)
            return
        left = f", {duration_text(seconds)} left" if seconds and done < self._total else ""
        self.note(f"{self._what}: {100 * done // self._total} %{left}")

    def tell(self, what: str) -> None:
        self._what, self._told = what, True

    def note(self, text: str) -> None:
        self._last_line_at = time.monotonic()
        super().note(text)

    def close(self) -> None:
        self._closed.set()

    def remind(self) -> None:
        """Prints what is being done if no line was printed for EVERY_S seconds."""
        now = time.monotonic()
        if now - self._last_line_at < EVERY_S:
            return
        if not self._what:
            self.note(f"preparing for {now - self._began:.0f} s{_compiling()}")
            return
        waited = f"{now - self._stepped_at:.0f} s"
        if self._total and self._done >= self._total:
            self.note(f"{self._what}: done, what follows takes {waited} so far")
            return
        told = f"this step for {waited}{_compiling()}"
        share = f"{100 * self._done // self._total} %, " if self._total else ""
        self.note(f"{self._what}: {share}{told}")


def _compiling() -> str:
    return "; a first run compiles" if compiled_within(EVERY_S) else ""


def _watch(progress: weakref.ref[LineProgress], closed: threading.Event) -> None:
    """Reminds every second, until the progress is closed or gone."""
    while not closed.wait(1.0):
        shown = progress()
        if shown is None:
            return
        shown.remind()
        del shown


class TerminalProgress(SilentProgress):
    """A progress bar on a terminal."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeElapsedColumn,
        )

        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),  # moves while a step compiles
            TextColumn("{task.fields[left]}"),
            console=Console(stderr=True),
        )
        self._progress.start()
        # Until the first stage, so that a wait is seen to go on.
        self._preparing: Any = self._progress.add_task("preparing", total=None, left="")
        self._task: Any = None
        self._total, self._pace = 0, Pace(0)

    def _prepared(self) -> None:
        if self._preparing is not None:
            self._progress.remove_task(self._preparing)
            self._preparing = None

    def start(self, what: str, total: int) -> None:
        self._prepared()
        self._total, self._pace = total, Pace(total)
        self._task = self._progress.add_task(one_line(what), total=total, left="")

    def advance(self, done: int) -> None:
        seconds = self._pace.step(done, time.monotonic())
        left = f"{duration_text(seconds)} left" if seconds and done < self._total else ""
        self._progress.update(self._task, completed=done, left=left)

    def tell(self, what: str) -> None:
        self._progress.update(self._task, description=one_line(what))
        task = next(each for each in self._progress.tasks if each.id == self._task)
        if task.total == 0:  # their number is not known
            task.total = None

    def note(self, text: str) -> None:
        line = f"viform: {one_line(text)}"
        self._progress.console.print(line, markup=False, highlight=False, soft_wrap=True)

    def close(self) -> None:
        self._prepared()
        self._progress.stop()


def make_progress() -> SilentProgress:
    """A bar if standard error is a terminal, else lines."""
    return TerminalProgress() if _on_a_terminal() else LineProgress()


def _on_a_terminal() -> bool:
    """Whether standard error is a terminal; programs without one have none at all."""
    return sys.stderr is not None and sys.stderr.isatty()


class _Collected(QuietProgress):
    """A progress that shows what another one shows, but collects the notes."""

    def __init__(self, shown: SilentProgress) -> None:
        super().__init__()
        self._shown = shown

    def start(self, what: str, total: int) -> None:
        self._shown.start(what, total)

    def advance(self, done: int) -> None:
        self._shown.advance(done)

    def tell(self, what: str) -> None:
        self._shown.tell(what)


def _in_notebook() -> bool:
    """Whether the caller is a cell of a Jupyter notebook, which shows a bar without a terminal."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"


@contextmanager
def progress_in_python(shown: bool | None) -> Iterator[QuietProgress]:
    """The progress of a function that is called in Python; its notes are for the caller.

    shown: whether it is shown, as a bar or, where standard error is no terminal, as lines; None for
        a bar on a terminal or in a notebook, and nothing elsewhere.
    """
    bar = _on_a_terminal() or _in_notebook()
    if shown is False or (shown is None and not bar):
        yield QuietProgress()
        return
    display = TerminalProgress() if bar else LineProgress()
    try:
        yield _Collected(display)
    finally:
        display.close()
