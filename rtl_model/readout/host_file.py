"""The file of bytes that a host gets, written in parts, over the interruptions of a run."""

from __future__ import annotations

from io import FileIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.files.durable import put, sync, sync_all

__all__ = ["HostFile"]


class HostFile:
    """A file that grows under a temporary name and gets its own name when it is whole.

    It is opened for each part, so that a run that ends early leaves nothing open.

    Args:
        path: of the whole file.

    Attributes:
        written: bytes so far, also of the run that is resumed.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._part = path, path.with_name(f"{path.name}.part")
        self._begun = False
        self.written = 0

    def resume(self, written: int) -> None:
        """Goes on after `written` bytes, which `damage` has found. Nothing is changed before the
        next `write`."""
        self.written = written

    def damage(self, written: int) -> str | None:
        """What is wrong if the file must have `written` bytes; None if it has."""
        there = self._there()
        size = there.stat().st_size if there.is_file() else 0
        return None if size >= written else f"{there} must have {written} bytes, not {size}"

    def _there(self) -> Path:
        """The file as it is: whole, if the run ended after its last block."""
        return self._path if self._path.is_file() and not self._part.is_file() else self._part

    def write(self, data: npt.NDArray[np.uint8]) -> None:
        """Appends a contiguous array. Raises OSError (full disk)."""
        if not self._begun and self._there() != self._part:
            put(self._path, self._part)
        self._begun = True
        with FileIO(self._part, "r+" if self.written else "w") as file:
            file.truncate(self.written)
            file.seek(self.written)
            left = data.reshape(-1).data
            while left:
                left = left[file.write(left) :]
        self.written += data.nbytes

    def settle(self) -> None:
        """Waits until the bytes and the name are on the disk."""
        there = self._there()
        if there.is_file():
            sync_all([there, there.parent])

    def finish(self) -> None:
        """Gives the file its name, once its bytes are on the disk."""
        sync(self._part)
        put(self._part, self._path)
