"""Says at the start of a long recording what it will take."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import Final

from cosim.run.progress import Pace, Progress, duration_text

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
