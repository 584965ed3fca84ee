"""A file system of a given size, private to a process: a tmpfs in a mount namespace of its own."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

_NEW_MOUNTS, _NEW_USER = 0x00020000, 0x10000000  # linux/sched.h
_READ_ONLY, _REMOUNT, _RECURSIVE, _PRIVATE = 1, 32, 1 << 14, 1 << 18  # linux/mount.h
_libc = ctypes.CDLL(None, use_errno=True)


class NoMounts(Exception):
    """The system does not permit a mount. Containers and kernels refuse it by several numbers."""


def _call(name: str, *arguments: object) -> None:
    if getattr(_libc, name)(*arguments):
        raise NoMounts(f"{name}: {os.strerror(ctypes.get_errno())}")


def mount_private(folder: Path, size: int) -> None:
    """Mounts a file system of `size` bytes on a folder, for this process alone.

    The process must have one thread. Raises NoMounts.
    """
    if os.geteuid() == 0:
        _call("unshare", _NEW_MOUNTS)
    else:
        _call("unshare", _NEW_MOUNTS | _NEW_USER)
    _call("mount", b"none", b"/", None, _RECURSIVE | _PRIVATE, None)
    _call("mount", b"viform", str(folder).encode(), b"tmpfs", 0, _size(size))


def resize(folder: Path, size: int, *, read_only: bool = False) -> None:
    """Changes the size of the mounted file system, and whether it may be written to."""
    flags = _REMOUNT | (_READ_ONLY if read_only else 0)
    _call("mount", b"viform", str(folder).encode(), b"tmpfs", flags, _size(size))


def _size(size: int) -> bytes:
    return f"size={max(size, 4096)}".encode()  # 0 is no limit
