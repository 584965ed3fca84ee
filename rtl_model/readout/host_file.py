"""The file of bytes that a host gets, written in parts, over the interruptions of a run."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from io import FileIO
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.files.durable import put, sync, sync_all

_PART: Final = 1 << 24
"""Bytes that are checked at a time."""


class HostFile:
    """A file that grows under a temporary name and gets its own name when it is whole.

    It is opened for each part, so that a run that ends early leaves nothing open.

    Args:
        path: path of the whole file.

    Attributes:
        written: bytes so far, also of the run that is resumed.
        crc: CRC-32 of them (ISO-HDLC, as in zlib).
    """

    def __init__(self, path: Path) -> None:
        self._path, self._part = path, path.with_name(f"{path.name}.part")
        self._begun = False
        self.written = self.crc = 0

    def resume(self, written: int, crc: int) -> None:
        """Goes on after `written` bytes, which `damage` has found sound. Nothing is changed before
        the next `write`."""
        self.written, self.crc = written, crc

    def damage(self, written: int, crc: int, checked: Callable[[int, int], None]) -> str | None:
        """What is wrong if the file must begin with `written` bytes of the CRC `crc`; None if it
        does. checked: see `WithFiles`."""
        there, parts, found = self._there(), -(-written // _PART), 0
        size = there.stat().st_size if there.is_file() else 0
        if size < written:
            return f"{there} must have {written} bytes, not {size}"
        if parts:
            with FileIO(there) as file:
                for n in range(parts):
                    found = zlib.crc32(file.read(min(_PART, written - n * _PART)), found)
                    checked(n + 1, parts)
        return None if found == crc else f"{there} must be as the run wrote it, not damaged"

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
            left = whole = data.reshape(-1).data
            while left:
                left = left[file.write(left) :]
        self.written += data.nbytes
        self.crc = zlib.crc32(whole, self.crc)

    def settle(self) -> None:
        """Waits until the bytes and the name are on the disk."""
        there = self._there()
        if there.is_file():
            sync_all([there, there.parent])

    def finish(self) -> None:
        """Gives the file its name, once its bytes are on the disk."""
        sync(self._part)
        put(self._part, self._path)
