"""Files that outlast a loss of power.

A system keeps what is written in memory for half a minute, and writes names and contents in any
order. A file is safe once it has been synced under its temporary name, renamed, and its folder has
been synced: then its name stands for its whole content or for nothing.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

_AT_A_TIME: Final = 8
"""Files that are synced at the same time: a journal writes them together. On the ext4 of a cloud
disk, 200 files of 4 KiB take .63 s one after another, and .02 s in eight threads."""
_NO_SYNC: Final = (errno.EINVAL, errno.ENOTSUP, errno.EACCES)
"""Error numbers of folders that cannot be synced: of some network file systems, or not readable."""


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
