"""Files that appear complete or not at all: written under a temporary name, then renamed."""

from __future__ import annotations

import errno
import glob
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from cosim.errors import InputError

__all__ = ["NO_ROOM", "refusal", "whole"]

NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What the system says where nothing more can be written."""


def refusal(path: Path, exc: OSError) -> InputError | OSError:
    """What to raise where the system refuses to write `path`: an InputError, but of a full disk the
    OSError itself with the file's name, since only the command knows how it goes on."""
    if exc.errno in NO_ROOM:
        exc.filename = exc.filename or str(path)
        return exc
    return InputError(
        f"{path}", "a name that can be written", f"refused ({exc.strerror or exc})",
        "choose another name",
    )  # fmt: skip


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A name beside `path` to write to, file or folder; it takes the place of `path` only when the
    block succeeds.

    Raises InputError where the system refuses to write, and where `path` is a folder of the user's
    own: only a Zarr store is replaced. OSError where the disk is full.
    """
    _remove_abandoned(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        _check(path)
        try:
            yield part
            if path.is_dir() and part.is_dir():
                shutil.rmtree(path)
            os.replace(part, path)
        finally:
            _remove(part)
    except OSError as exc:
        raise refusal(path, exc) from exc


def _remove_abandoned(path: Path) -> None:
    """Removes the parts of `path` that killed processes have left."""
    for part in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        number = part.name.split(".")[-2]
        if number.isdecimal() and not _alive(int(number)):
            _remove(part)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # another user's
        return True
    return True


def _remove(part: Path) -> None:
    """Removes what is left of a part. Threads that write a store's chunks may outlive an interrupt
    by a moment, so a folder is tried a few times."""
    if not part.is_dir():
        part.unlink(missing_ok=True)
        return
    for _ in range(40):
        shutil.rmtree(part, ignore_errors=True)
        if not part.exists():
            return
        time.sleep(0.05)


def _check(path: Path) -> None:
    if path.is_dir() and not (path / "zarr.json").is_file():
        raise InputError(f"{path}", "a new name", "a folder that is there", "choose another name")
    if not path.parent.is_dir():
        raise InputError(
            f"{path}", "in a folder that exists", f"in {path.parent}", f"mkdir -p {path.parent}"
        )
