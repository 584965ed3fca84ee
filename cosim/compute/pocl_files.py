"""The files of PoCL's cache and their sums: a damaged one is dropped before PoCL uses it.

PoCL trusts its cache. A file of no bytes, one that is cut, or one with other content ends the
process (signals 6, 7 and 11) at every start, or computes something else. So the sums of its files
are kept beside them, and of a program only files with a sum that is right are left to PoCL:

    AB/CDEF.../program.bc            a program; the folder's name is a hash that PoCL forms
    AB/CDEF.../KERNEL/SIZE/KERNEL.so a kernel, compiled when it is first launched with this size
    AB/CDEF.../last_accessed         touched by PoCL whenever it builds the program
    sums/KEY                         ours, of each program: its folder, and its files

A program's folder is the one that PoCL touches while it builds it. Processes build new programs one
after another, so that there is one such folder without sums. The files of a program are added to
its sums after it is built, and when the process ends. What a process left that was killed has no
sum; it is dropped as soon as no process uses the cache, and so is what no sum names.
"""

from __future__ import annotations

import fcntl
import json
import os
import threading
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any, Final

from cosim.errors import say

_SUMS: Final = "sums"
_ACCESSED: Final = "last_accessed"
_WAIT_S: Final = 120
"""Longest wait for another process that compiles."""
_RECENT_S: Final = 2
"""Resolution of the times of a coarse file system, with a margin."""
_OPEN: Final[list[PoclFiles]] = []


class PoclFiles:
    """The files that this process uses.

    Args:
        folder: POCL_CACHE_DIR.
        own: whether no other software uses the folder, so that what no sum names may be dropped.

    Raises:
        OSError: the folder cannot be written.
    """

    def __init__(self, folder: Path, own: bool) -> None:
        self._folder = folder
        self._sums = folder / _SUMS
        self._sums.mkdir(parents=True, exist_ok=True)
        self._used: dict[str, dict[str, Any]] = {}
        self._cleared = not own
        self._busy = threading.RLock()
        self._users = os.open(self._sums / ".users", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
        fcntl.flock(self._users, fcntl.LOCK_SH)
        Finalize(None, self.keep, exitpriority=0)  # workers end without the handlers of atexit

    @contextmanager
    def building(self, key: str) -> Iterator[None]:
        """While the program of `key` is built: before, its damaged files are dropped; after, its
        sums are kept.

        key: tells programs apart, by their source, options, device and driver; a file's name.
        """
        with self._busy:
            record = self._checked(key)
            if record is None:
                with self._alone_with_the_compiler():
                    record = self._checked(key)  # the process that was waited for may have made it
                    if record is None:
                        yield from self._first(key)
                        return
            accessed = self._folder / record["folder"] / _ACCESSED
            before = _modified(accessed)
            yield
            if _modified(accessed) == before < time.time_ns() - _RECENT_S * 10**9:
                # An included file or the compiler has changed: PoCL took another folder.
                _drop(self._sums / key)
            else:
                self._used[key] = record

    def keep(self) -> None:
        """Adds the files that were compiled since to the sums."""
        if not self._busy.acquire(timeout=1):  # a thread compiles while the process ends
            return
        try:
            for key, record in self._used.items():
                new = _listed(self._folder / record["folder"]) - record["files"].keys()
                found = {name: _sum(self._folder / record["folder"] / name) for name in new}
                record["files"] |= {name: told for name, told in found.items() if told}
                if new:
                    self._write(key, record)
        finally:
            self._busy.release()

    def _first(self, key: str) -> Iterator[None]:
        """Builds a program without sums."""
        if not self._cleared:
            self._drop_nameless()
        before = self._accessed()
        yield
        found = [name for name, when in self._accessed().items() if before.get(name) != when]
        if len(found) > 1:  # other processes build programs that have sums
            named = {record["folder"] for record in _records(self._folder).values()}
            found = [name for name in found if name not in named]
        if len(found) == 1:
            self._used[key] = {"folder": found[0], "files": {}}
            self.keep()

    def _checked(self, key: str) -> dict[str, Any] | None:
        """The sums of a program, whose wrong files are dropped; None if it must be compiled."""
        record = _read(self._sums / key)
        if record is None:
            return None
        place = self._folder / record["folder"]
        if not (place / "program.bc").exists():
            _drop(self._sums / key)
            return None
        there = _listed(place)
        if there - record["files"].keys():
            for other in _records(self._folder).values():
                if other["folder"] == record["folder"]:  # a source that PoCL takes for the same
                    record["files"] = other["files"] | record["files"]
        if _damaged(place, record):
            count = drop_damaged(self._folder)  # all at once, to say it in one line
            if count:
                say(
                    f"files of the cache {self._folder} were damaged ({count}); they are dropped "
                    "and compiled again"
                )
            record = _read(self._sums / key)
            if record is None:
                return None
        nameless = there - record["files"].keys()
        record["files"] = {name: told for name, told in record["files"].items() if name in there}
        if nameless and self._alone():
            for name in nameless:
                _drop(place / name)
        return record

    def _drop_nameless(self) -> None:
        """Drops the files of programs without sums, if no other process may be using them. Once:
        then some are this process's own."""
        self._cleared = True
        there = set(self._accessed())
        named = {record["folder"] for record in _records(self._folder).values()}
        if there - named and self._alone():
            for folder in there - named:
                for name in _listed(self._folder / folder):
                    _drop(self._folder / folder / name)

    def _accessed(self) -> dict[str, int]:
        """When PoCL last built the program of each folder, ns."""
        return {
            str(path.parent.relative_to(self._folder)): _modified(path)
            for path in self._folder.glob(f"??/*/{_ACCESSED}")
        }

    def _alone(self) -> bool:
        """Whether no other process uses the cache."""
        try:
            fcntl.flock(self._users, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        finally:
            fcntl.flock(self._users, fcntl.LOCK_SH)
        return True

    @contextmanager
    def _alone_with_the_compiler(self) -> Iterator[None]:
        """Waits until no other process compiles a new program, but not for ever."""
        lock = os.open(self._sums / ".compiler", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
        try:
            end = time.monotonic() + _WAIT_S
            while time.monotonic() < end:
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    time.sleep(0.02)
            yield
        finally:
            os.close(lock)

    def _write(self, key: str, record: dict[str, Any]) -> None:
        part = self._sums / f".{key}.{os.getpid()}"
        with suppress(OSError):  # a full disk: compiled again at the next start
            part.write_text(json.dumps(record), encoding="utf-8")
            os.replace(part, self._sums / key)
        _drop(part)


@cache
def pocl_files(folder: Path, own: bool) -> PoclFiles | None:
    """The files that this process uses, see `PoclFiles`; None if the folder cannot be written."""
    try:
        _OPEN.append(PoclFiles(folder, own))
    except OSError:
        return None
    return _OPEN[-1]


def keep_sums() -> None:
    """Adds the files that this process has compiled to their sums, before it may be killed."""
    for files in _OPEN:
        files.keep()


def drop_damaged(folder: Path) -> int:
    """Drops the programs in PoCL's cache `folder` that have damaged files. Returns the number of
    these files."""
    records = _records(folder)
    places = {
        record["folder"]: count
        for record in records.values()
        if (count := _damaged(folder / record["folder"], record))
    }
    for key, record in records.items():
        if record["folder"] in places:
            _drop(folder / _SUMS / key)
    for place in places:
        for name in _listed(folder / place):
            _drop(folder / place / name)
    return sum(places.values())


def _records(folder: Path) -> dict[str, dict[str, Any]]:
    """The sums of each program, by key."""
    found = {path.name: _read(path) for path in (folder / _SUMS).glob("[!.]*")}
    return {key: record for key, record in found.items() if record is not None}


def _read(path: Path) -> dict[str, Any] | None:
    """The sums of a program; None if there are none, or they are damaged themselves."""
    with suppress(OSError, ValueError, TypeError, KeyError, AttributeError):
        record = json.loads(path.read_text(encoding="utf-8"))
        return {
            "folder": str(record["folder"]),
            "files": {str(name): list(told) for name, told in record["files"].items()},
        }
    return None


def _damaged(place: Path, record: dict[str, Any]) -> int:
    """Number of files of a program that are there, but not as they were written."""
    found = {name: _sum(place / name) for name in record["files"]}
    return sum(bool(told) and told != record["files"][name] for name, told in found.items())


def _listed(place: Path) -> set[str]:
    """Names of the compiled files of a program."""
    found = {"program.bc"} if (place / "program.bc").exists() else set()
    return found | {str(path.relative_to(place)) for path in place.glob("*/*/*.so")}


def _sum(path: Path) -> list[int]:
    """Size and CRC-32 of a file; none if it is not there."""
    try:
        data = path.read_bytes()
    except OSError:
        return []
    return [len(data), zlib.crc32(data)]


def _modified(path: Path) -> int:
    """Time of the last change of a file, ns; 0 if it is not there."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _drop(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
