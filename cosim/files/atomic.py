"""Atomic writing of files: under a temporary name, which is then renamed. A reader, or the next
start after a loss of power, finds the whole file or none."""

from __future__ import annotations

import errno
import glob
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Final

from cosim.compute.stopping import heed
from cosim.errors import InputError
from cosim.files.durable import put, sync, sync_tree

NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Error numbers of a full disk, and of a file that is larger than the user or the disk allows."""

_AWAY: Final = 3
"""Times in a row, 50 ms apart, that a removed folder is found to be away."""
_NUMBERS: Final = count()
"""Numbers of temporary files: two threads of this process may write the same file, one of them for
work that was given up."""


def how_to_make_room(exc: OSError) -> str:
    """Instruction to the user after an error of NO_ROOM."""
    if exc.errno == errno.EFBIG:
        return "raise the limit of a file's size (ulimit -f)"
    return "make room"


def refusal(path: Path, exc: OSError) -> InputError | OSError:
    """The exception to raise if `path` cannot be written: an InputError. For a full disk it is an
    OSError with the name of the file, because only the command knows how to continue."""
    if exc.errno in NO_ROOM:
        # Not `exc` itself: FFmpeg's errors are a subclass, whose file name cannot be set.
        return OSError(exc.errno, exc.strerror, exc.filename or str(path))
    return InputError(
        f"{path}", "a name that can be written", f"refused ({exc.strerror or exc})",
        "choose another name",
    )  # fmt: skip


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A temporary name for a file or folder, which replaces `path` only if the context succeeds.

    Raises:
        InputError: the file cannot be written, or `path` is a folder other than a Zarr store.
        OSError: the disk is full.
    """
    _remove_abandoned(path)
    part = path.with_name(f".{path.name}.{next(_NUMBERS)}.{os.getpid()}.part")
    try:
        _check(path)
        try:
            yield part
            heed()  # nobody wants a file of work that was given up
            (sync_tree if part.is_dir() else sync)(part)
            if path.is_dir() and part.is_dir():
                shutil.rmtree(path)
            put(part, path)
        finally:
            _remove(part)
    except OSError as exc:
        raise refusal(path, exc) from exc


def _remove_abandoned(path: Path) -> None:
    """Removes temporary files for `path` of processes that no longer exist."""
    for part in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        number = part.name.split(".")[-2]
        if number.isdecimal() and not _alive(int(number)):
            _remove(part)


def remove_parts(folder: Path) -> None:
    """Removes all temporary files below a folder, of `atomic_write` and of stores. The caller knows
    that no other process writes there."""
    for place, below, names in os.walk(folder):
        for name in [*below, *names]:
            hidden = name.startswith(".") and name.endswith(".part")
            if hidden or name.endswith(".partial"):
                _remove(Path(place) / name)


def _alive(process: int) -> bool:
    """Whether a process exists."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # a process of another user
        return True
    return True


def _remove(part: Path) -> None:
    """Removes a temporary file or folder. Threads that write chunks of a store may continue for a
    moment after an interrupt and make the folder anew, so it must stay away for a while."""
    if not part.is_dir():
        part.unlink(missing_ok=True)
        return
    away = 0
    for _ in range(40):
        shutil.rmtree(part, ignore_errors=True)
        away = 0 if part.exists() else away + 1
        if away == _AWAY:
            return
        time.sleep(0.05)


def _check(path: Path) -> None:
    """Raises InputError if `path` must not be replaced, or its folder does not exist."""
    if path.is_dir() and not (path / "zarr.json").is_file():
        raise InputError(f"{path}", "a new name", "a folder that is there", "choose another name")
    if not path.parent.is_dir():
        raise InputError(
            f"{path}", "in a folder that exists", f"in {path.parent}", f"mkdir -p {path.parent}"
        )


def identity(path: Path) -> tuple[int, ...] | None:
    """Device, inode, size and time of a file, None if there is none. Those of another file that
    takes its name differ, and those of the same one once it is written again."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns
