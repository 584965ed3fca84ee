"""Compiles kernels for one drive, with the functions of the drive inlined.

A kernel is a plain function that calls `level` and `remember` of this file. numba cannot cache a
kernel with functions as arguments or in a closure. Therefore `compiled` copies the kernel, with the
functions of the drive as globals and a separate name in the cache on disk.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from types import FunctionType
from typing import Any

from numba import njit

from display.drives.drive import Drive


def level(age: float, tau: float, memory: float) -> float:
    """Placeholder of the drive's `level` in a kernel."""
    raise NotImplementedError


def remember(memory: float, interval: float, emitted: float) -> float:
    """Placeholder of the drive's `remember` in a kernel."""
    raise NotImplementedError


def _unchanged(memory: float, interval: float, emitted: float) -> float:
    return memory


def _fingerprint(*functions: Callable[..., Any]) -> str:
    """Hexadecimal digest of the code and the constants of functions, and of those that they
    call."""
    parts = []
    for function in functions:
        assert isinstance(function, FunctionType)
        code = function.__code__
        used = [function.__globals__.get(name) for name in code.co_names]
        numbers = [value for value in used if isinstance(value, int | float)]
        called = _fingerprint(*(value for value in used if isinstance(value, FunctionType)))
        parts.append((code.co_code, code.co_consts, code.co_names, numbers, called))
    return sha256(repr(parts).encode()).hexdigest()[:8] if parts else ""


@cache
def compiled(kernel: Callable[..., None], drive: Drive) -> Callable[..., None]:
    """`kernel` with the functions of the drive, compiled at its first call."""
    assert isinstance(kernel, FunctionType)
    functions = {"level": drive.level, "remember": drive.remember or _unchanged}
    name = f"{kernel.__name__}_{drive.name}_{_fingerprint(*functions.values())}"
    scope: dict[str, Any] = kernel.__globals__ | {
        # Division by zero as in numpy: an exception as in Python would prevent vectorisation.
        key: njit(nogil=True, error_model="numpy")(function)
        for key, function in functions.items()
    }
    copy = FunctionType(kernel.__code__, scope, name, kernel.__defaults__)
    copy.__qualname__, copy.__module__ = name, kernel.__module__
    return njit(cache=True, nogil=True)(copy)
