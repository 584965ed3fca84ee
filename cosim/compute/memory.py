"""Check of free memory before a large allocation."""

from __future__ import annotations

import psutil

from cosim.errors import InputError

__all__ = ["check_memory"]

_GIB = 2**30


def check_memory(what: str, need: int, remedy: str) -> None:
    """Raises InputError if `need` bytes exceed the free memory. what, remedy: for its message."""
    free = int(psutil.virtual_memory().available)
    if need > free:
        must = f"small enough for the {free / _GIB:.3g} GiB of memory that is free"
        raise InputError(what, must, f"{need / _GIB:.3g} GiB", remedy)
