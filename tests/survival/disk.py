"""What a disk is sure to hold: calls that reach it, noted by a layer over the functions of `os`.

A file is safe if it has not changed since it was synced, and a name if its folder was synced while
it held it. This is what POSIX promises, and less than most file systems keep.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock


class Disk:
    """The calls of a process, as far as they count.

    Attributes:
        unsafe: by the name that a file was given, what was not safe then.
        named: names that were given, in their order.
        synced_since: whether the folder of the last named file has been synced since.
    """

    def __init__(self, folder: Path, watch: Callable[[str], bool]) -> None:
        self._folder, self._watch = folder, watch
        self._files: dict[int, tuple[int, int]] = {}
        self._folders: dict[int, set[str]] = {}
        self.unsafe: dict[str, list[str]] = {}
        self.named: list[str] = []
        self.synced_since: dict[str, bool] = {}

    def fsync(self, number: int) -> None:
        status = os.fstat(number)
        place = Path(f"/proc/self/fd/{number}").resolve()
        if place.is_dir():
            self._folders[status.st_ino] = set(os.listdir(place))
            for name in self.synced_since:
                if (self._folder / name).parent == place:
                    self.synced_since[name] = True
        else:
            self._files[status.st_ino] = (status.st_mtime_ns, status.st_size)

    def replace(self, part: Path, path: Path) -> None:
        if not Path(path).is_relative_to(self._folder):
            return
        name = str(Path(path).relative_to(self._folder))
        self.named.append(name)
        if self._watch(name):
            self.unsafe[name] = sorted(self._at_risk(Path(part)))
            self.synced_since[name] = False

    def _at_risk(self, part: Path) -> Iterator[str]:
        """What a loss of power now could take, with the file that is about to be named."""
        for place, folders, names in os.walk(self._folder):
            at = Path(place)
            known = self._folders.get(at.stat().st_ino, set())
            for name in {*folders, *names} - known:
                if at / name != part:
                    yield f"name of {(at / name).relative_to(self._folder)}"
            for name in names:
                status = (at / name).stat()
                if self._files.get(status.st_ino) != (status.st_mtime_ns, status.st_size):
                    yield f"content of {(at / name).relative_to(self._folder)}"


@contextmanager
def watched(folder: Path, watch: Callable[[str], bool]) -> Iterator[Disk]:
    """Notes the calls within the context.

    Args:
        folder: that counts.
        watch: whether everything in the folder must be safe before a file gets this name.
    """
    disk, fsync, replace = Disk(folder, watch), os.fsync, os.replace

    def synced(number: int) -> None:
        fsync(number)
        disk.fsync(number)

    def replaced(part: Any, path: Any, **options: Any) -> None:
        disk.replace(part, path)
        replace(part, path, **options)

    with mock.patch("os.fsync", synced), mock.patch("os.replace", replaced):
        yield disk
