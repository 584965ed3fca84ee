"""Large files past the system's file cache.

A recording without compression writes gigabytes that are not read soon. Through the file cache the
system clears a page for each 4 KiB and copies into it, which costs more processor time than the
chip that made the bits. Direct writes cost the disk's time alone. Where the file system has none,
or where the disk is slow, the cache is the better way: it takes what comes and writes it later.
"""

from __future__ import annotations

import asyncio
import mmap
import os
import threading
import time
import uuid
from pathlib import Path
from typing import Any, Final

from zarr.core.buffer import Buffer
from zarr.storage import LocalStore

_LEAST: Final = 1 << 20
"""Bytes of a file from which on it is written directly."""
_ALIGNED: Final = 4096
"""Direct writes begin in memory and in the file at multiples of this, in bytes: the largest size of
a sector that disks have."""
_SLOW: Final = 1.5e8
"""Bytes a second of one write, of two at a time, below which a disk is slow."""
_GRACE: Final = 1.0
"""Seconds that all writes together may take longer than on a slow disk: one delay of the disk does
not decide."""
_LOCAL = threading.local()


def _memory(size: int) -> mmap.mmap:
    """Aligned memory of this thread, at least so many bytes."""
    memory: mmap.mmap | None = getattr(_LOCAL, "memory", None)
    if memory is None or len(memory) < size:
        memory = _LOCAL.memory = mmap.mmap(-1, size)
    return memory


def _open(path: Path) -> int | None:
    """A descriptor of a new file for direct writes, None where the system has none."""
    flag = getattr(os, "O_DIRECT", 0)  # not on macOS and Windows
    try:
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | flag, 0o666) if flag else None
    except OSError:  # such as tmpfs before Linux 6.6
        return None


def _write(fd: int, data: memoryview) -> None:
    done = 0
    while done < len(data):
        done += os.write(fd, data[done:])


def _put(path: Path, value: memoryview) -> float | None:
    """Writes a file as a whole or not at all. Returns the seconds that its direct write took, None
    if the file system has no direct writes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{uuid.uuid4().hex}.partial")
    aligned = len(value) // _ALIGNED * _ALIGNED
    fd = _open(part)
    seconds = None
    try:
        if fd is None:
            fd = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
            _write(fd, value)
        else:
            import fcntl

            memory = memoryview(_memory(aligned))[:aligned]
            memory[:] = value[:aligned]
            begin = time.perf_counter()
            _write(fd, memory)
            seconds = time.perf_counter() - begin
            # the rest is no whole sector
            fcntl.fcntl(fd, fcntl.F_SETFL, fcntl.fcntl(fd, fcntl.F_GETFL) & ~os.O_DIRECT)
            _write(fd, value[aligned:])
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    finally:
        if fd is not None:
            os.close(fd)
    part.replace(path)
    return seconds


class DirectStore(LocalStore):
    """A local store that writes large values directly as long as the disk keeps up."""

    def __init__(self, root: Path | str, **kwargs: Any) -> None:
        super().__init__(root, **kwargs)
        self._direct, self._late = True, 0.0

    async def set(self, key: str, value: Buffer) -> None:
        """Writes a value whole or not at all, as `LocalStore` does."""
        if not self._direct or len(value) < _LEAST:
            await super().set(key, value)
            return
        data = memoryview(value.as_buffer_like()).cast("B")
        seconds = await asyncio.to_thread(_put, self.root / key, data)
        if seconds is not None:
            self._late += seconds - len(data) / _SLOW
        self._direct = seconds is not None and self._late < _GRACE
