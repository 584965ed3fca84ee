"""The cache of numba on a disk that takes no more: compiled functions are used and not kept.

numba raises what a write of its cache raises, and the run would end although its function is
compiled. It has no option for this. But it calls the entry point "init" of the group
"numba_extensions" before it compiles anything (numba's manual, "Registering extensions with entry
points"). Ours in `pyproject.toml` is `tolerate`; so nothing imports numba before it is needed.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

__all__ = ["tolerate"]


def tolerate() -> None:
    """From now on, a compiled function that the disk does not take is not kept."""
    from numba.core.caching import FunctionCache

    keep = FunctionCache.save_overload

    def save_overload(self: Any, sig: Any, data: Any) -> None:
        with suppress(OSError):
            keep(self, sig, data)

    FunctionCache.save_overload = save_overload  # type: ignore[method-assign]
