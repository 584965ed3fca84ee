"""Check of free memory before a large allocation."""

from __future__ import annotations

from typing import Final

import psutil

from cosim.errors import InputError

__all__ = ["check_memory", "check_plane", "free_memory"]

_GIB = 2**30
_PLANE: Final = 32
"""Bytes that each pixel of a stream takes at least while it is read: two words of 32 cycles, their
copy, and a float64 and what it is computed from."""


def free_memory() -> int:
    """Bytes that this process may still take: what the machine has, and its own limit."""
    free = int(psutil.virtual_memory().available)
    try:
        import resource  # not on Windows
    except ImportError:
        return free
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY:
        free = min(free, most - int(psutil.Process().memory_info().vms))
    return max(free, 0)


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
