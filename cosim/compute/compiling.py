"""Whether this process compiles: a first run takes half a minute longer, and says so."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

_state = {"now": 0, "last": float("-inf")}
"""How many functions are being compiled, and when the last one was, s of the monotonic clock."""


@contextmanager
def compiles() -> Iterator[None]:
    """Context of a compilation."""
    begin_compiling()
    try:
        yield
    finally:
        end_compiling()


def begin_compiling() -> None:
    """Notes that a compilation of a function or a kernel begins."""
    _state["now"] += 1


def end_compiling() -> None:
    """Notes that the compilation has ended."""
    _state["now"] -= 1
    _state["last"] = time.monotonic()


def compiled_within(seconds: float) -> bool:
    """Whether something is being compiled, or was in the last seconds."""
    return _state["now"] > 0 or time.monotonic() - _state["last"] < seconds
