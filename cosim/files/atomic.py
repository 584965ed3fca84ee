"""Atomic writing of files: under a temporary name, which is then renamed. A reader, or the next
start after a loss of power, finds the whole file or none.

A system keeps what is written in memory for half a minute, and writes names and contents in any
order. A file is safe once it has been synced under its temporary name, renamed, and its folder has
been synced: then its name stands for its whole content or for nothing.
"""

from __future__ import annotations

import errno
import glob
import os
import shutil
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Final

from cosim.compute.stopping import heed
from cosim.errors import InputError

NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Error numbers of a full disk, and of a file that is larger than the user or the disk allows."""
_AWAY: Final = 3
"""Times in a row, 50 ms apart, that a removed folder is found to be away."""
_NUMBERS: Final = count()
"""Numbers of temporary files: two threads of this process may write the same file, one of them for
work that was given up."""
_AT_A_TIME: Final = 8
"""Files that are synced at the same time: a journal writes them together. On the ext4 of a cloud
disk, 200 files of 4 KiB take .63 s one after another, and .02 s in eight threads."""
_NO_SYNC: Final = (errno.EINVAL, errno.ENOTSUP, errno.EACCES)
"""Error numbers of folders that cannot be synced: of some network file systems, or not readable."""


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


def remove_parts(folder: Path) -> None:
    """Removes all temporary files below a folder, of `atomic_write` and of stores. The caller knows
    that no other process writes there."""
    for place, below, names in os.walk(folder):
        for name in [*below, *names]:
            hidden = name.startswith(".") and name.endswith(".part")
            if hidden or name.endswith(".partial"):
                _remove(Path(place) / name)


def identity(path: Path) -> tuple[int, ...] | None:
    """Device, inode, size and time of a file, None if there is none. Those of another file that
    takes its name differ, and those of the same one once it is written again."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


def sync(path: Path) -> None:
    """Waits until a file, or the names in a folder, are on the disk."""
    folder = path.is_dir()
    try:
        number = os.open(path, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
    except OSError as exc:
        if not folder or exc.errno not in _NO_SYNC:
            exc.filename = str(path)
            raise


def sync_all(paths: Iterable[Path]) -> None:
    """`sync` of each path, several at a time."""
    with ThreadPoolExecutor(_AT_A_TIME) as pool:
        list(pool.map(sync, paths))


def sync_tree(folder: Path, without: Iterable[str] = ()) -> None:
    """Syncs all files below a folder, and then all folders.

    without: names in the folder that are left out.
    """
    left_out = {folder / name for name in without}
    files: list[Path] = []
    folders: list[Path] = []
    for place, below, names in os.walk(folder):
        at = Path(place)
        below[:] = [name for name in below if at / name not in left_out]
        folders.append(at)
        files += [at / name for name in names if not (at / name).is_symlink()]
    sync_all(files)
    sync_all(folders)


def put(part: Path, path: Path) -> None:
    """Gives a file or a folder, whose content is on the disk, its name, which outlasts a loss of
    power too."""
    os.replace(part, path)
    sync(path.parent)


def _remove_abandoned(path: Path) -> None:
    """Removes temporary files for `path` of processes that no longer exist."""
    for part in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        number = part.name.split(".")[-2]
        if number.isdecimal() and not _alive(int(number)):
            _remove(part)


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
