"""Kernels compiled for one drive, whose functions are inlined.

A kernel is a plain function that calls `level` and `remember` of this file. numba cannot cache a
kernel that takes functions as arguments or closes over them, so `compiled` gives a copy of the
kernel the drive's functions as globals, under a name of its own in the cache on disk.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from types import FunctionType
from typing import Any

from numba import njit

from display.drives.drive import Drive

__all__ = ["compiled", "level", "remember"]


def level(age: float, tau: float, memory: float) -> float:
    """Stands for the drive's `level` in a kernel."""
    raise NotImplementedError


def remember(memory: float, tau: float, interval: float) -> float:
    """Stands for the drive's `remember` in a kernel."""
    raise NotImplementedError


def _unchanged(memory: float, tau: float, interval: float) -> float:
    return memory


def _fingerprint(*functions: Callable[..., Any]) -> str:
    """Hexadecimal digits that differ between functions of other code or constants."""
    parts = []
    for function in functions:
        assert isinstance(function, FunctionType)
        code = function.__code__
        constants = [function.__globals__.get(name) for name in code.co_names]
        numbers = [value for value in constants if isinstance(value, int | float)]
        parts.append((code.co_code, code.co_consts, code.co_names, numbers))
    return sha256(repr(parts).encode()).hexdigest()[:8]


@cache
def compiled(kernel: Callable[..., None], drive: Drive) -> Callable[..., None]:
    """`kernel` with the drive's functions, compiled on its first call."""
    assert isinstance(kernel, FunctionType)
    functions = {"level": drive.level, "remember": drive.remember or _unchanged}
    name = f"{kernel.__name__}_{drive.name}_{_fingerprint(*functions.values())}"
    scope: dict[str, Any] = kernel.__globals__ | {
        # numpy's division by zero: Python's would keep loops from being vectorised.
        key: njit(nogil=True, error_model="numpy")(function)
        for key, function in functions.items()
    }
    copy = FunctionType(kernel.__code__, scope, name, kernel.__defaults__)
    copy.__qualname__, copy.__module__ = name, kernel.__module__
    return njit(cache=True, nogil=True)(copy)
