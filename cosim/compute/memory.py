"""Check of free memory before a large allocation, and the process's limits."""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from typing import Final

import psutil

from cosim.compute.cgroup import free_in_groups
from cosim.compute.cores import cores
from cosim.errors import InputError

_GIB = 2**30
LITTLE: Final = 16 << 20
"""Bytes for which a call need not ask for free memory: to read the limits takes longer."""
_PLANE: Final = 32
"""Bytes that each pixel of a stream takes at least while it is read: two words of 32 cycles, their
copy, and a float64 and what it is computed from."""

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Numbers of these parameters in glibc's malloc.h."""
_HEAP: Final = 128 << 20
_MAPPED: Final = 16 << 20
"""Bytes from which an allocation is not a part of the heap."""
_LIBRARIES: Final = 400 << 20
"""Bytes of addresses of the libraries that a run loads, beyond those in memory: OpenCL with its
compiler, OpenGL, FFmpeg."""
_THREAD: Final = 72 << 20
"""Bytes of addresses of a thread: 8 MiB of stack and 64 MiB of the allocator (glibc's arenas). Each
core has one of OpenCL and one of numba."""


@cache
def keep_freed() -> None:
    """Lets the allocator of the C library keep up to _HEAP bytes that are freed, once in a process.

    By default it returns planes of light to the system and gets them anew, page by page: ten times
    as long as a product of a plane takes.
    """
    try:
        change = ctypes.CDLL(None).mallopt  # glibc
    except (AttributeError, OSError, TypeError):
        return
    change(_TRIM_THRESHOLD, _HEAP)
    change(_MMAP_THRESHOLD, _MAPPED)


def free_memory() -> int:
    """Bytes that this process may still take: what the machine has, what its control groups leave,
    and its own limit."""
    return max(min(_present(), _addresses()), 0)


def _present() -> int:
    """Bytes of memory that the machine, or a group of processes, has for this one."""
    free = int(psutil.virtual_memory().available)
    group = free_in_groups()
    return free if group is None else min(free, group)


def _addresses() -> int:
    """Bytes by which the address space may still grow."""
    most = _limit("RLIMIT_AS")
    return most if most == sys.maxsize else most - int(psutil.Process().memory_info().vms)


def largest_file() -> int:
    """Bytes that a file of this process may have."""
    return _limit("RLIMIT_FSIZE")


def _limit(name: str) -> int:
    """A limit of this process by its name in `resource`; sys.maxsize for none."""
    try:
        import resource  # not on Windows
    except ImportError:
        return sys.maxsize
    most, _ = resource.getrlimit(getattr(resource, name))
    return sys.maxsize if most == resource.RLIM_INFINITY else most


def check_program(what: str, need: int, remedy: str, *, loaded: bool = False) -> None:
    """Raises InputError if the free memory does not hold a program that takes `need` bytes in all.

    Under a limit of the address space (`ulimit -v`) libraries count whole, and so do the stacks of
    threads.

    Args:
        what, remedy: subject of the message, and its advice.
        need: bytes of the program with its data at its peak.
        loaded: whether its libraries are loaded already.
    """
    memory = psutil.Process().memory_info()
    more = need - int(memory.rss) + _THREAD * 2 * cores() + (0 if loaded else _LIBRARIES)
    left = _addresses()
    if more > left:
        raise InputError(
            "the limit of the address space (ulimit -v)",
            f"{(int(memory.vms) + more) / _GIB:.3g} GiB or more for this run",
            f"{(int(memory.vms) + left) / _GIB:.3g} GiB", f"raise it, or {remedy}",
        )  # fmt: skip
    check_memory(what, need, remedy)


def check_memory(what: str, need: int, remedy: str) -> None:
    """Raises InputError if `need` bytes exceed the free memory. what, remedy: for its message."""
    free = free_memory()
    if need > free:
        must = f"small enough for the {free / _GIB:.3g} GiB of memory that is free"
        raise InputError(what, must, f"{need / _GIB:.3g} GiB", remedy)


def check_plane(what: str, shape: tuple[int, int]) -> None:
    """Raises InputError if memory does not suffice to read planes of (height, width) pixels, which
    a file of a few bytes may state."""
    height, width = shape
    remedy = "check the file, or use a machine with more"
    check_memory(f"{what}, {width}x{height} pixels", _PLANE * height * width, remedy)
