"""Says at the start of a long recording what it will take."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import Final

from cosim.run.progress import Progress, duration_text

__all__ = ["Foresight"]

_WATCHED_S: Final = 4.0
"""Time for which a recording is watched before it is extrapolated."""
_LEAST_S: Final = 10.0
"""Shorter recordings are not worth a line."""


def _size(folder: Path) -> int:
    """Bytes of the files below a folder; another thread may rename them meanwhile."""
    size = 0
    for place in folder.rglob("*"):
        with suppress(OSError):
            size += place.stat().st_size if place.is_file() else 0
    return size


class Foresight:
    """Passes progress on, and notes the time and the disk space of the whole recording as soon as
    its speed is known. The first step is left out of the speed, because kernels are compiled in it.

    Args:
        progress: receives everything.
        folder: folder into which the recording is written.
    """

    def __init__(self, progress: Progress, folder: Path) -> None:
        self._progress, self._folder = progress, folder
        self._what, self._total, self._said = "", 0, False
        self._began, self._steps = 0.0, 0
        self._first: tuple[int, float] | None = None

    def start(self, what: str, total: int) -> None:
        self._progress.start(what, total)
        self._what, self._total, self._said = what, total, False
        self._began, self._steps, self._first = time.monotonic(), 0, None

    def advance(self, done: int) -> None:
        self._progress.advance(done)
        now, self._steps = time.monotonic(), self._steps + 1
        if self._steps <= 2:  # the beginning of the run, and the end of its first step
            self._first = done, now
        elif self._first is not None and not self._said and now - self._first[1] >= _WATCHED_S:
            self._said = True
            at, since = self._first
            if done > at and self._total:
                left = (self._total - done) * (now - since) / (done - at)
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
