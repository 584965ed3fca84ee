"""Memory of results that is used again.

The system gives fresh memory page by page, at its first touch. For a kernel that writes a result as
fast as memory takes it, that is half of the time (measured: 64 MB of words of a static scene,
15 ms of kernel and 10 ms of page faults).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt

New = Callable[[int, "np.dtype[Any]"], npt.NDArray[Any]]

_KEPT = 3
"""Memories that are kept: one that is written, one that is read, and one between them."""
_LARGEST = 1 << 27
"""Bytes of a memory up to which several are kept. Of larger ones one is kept: a run states what it
needs before it begins."""
_FREE = 2
"""References to a memory that only the list and the question for its references hold."""


class Outputs:
    """Hands out arrays of one dtype; memory that nobody refers to any more is handed out again.

    An array keeps its memory as long as it, or any view of it, exists.

    Args:
        dtype: dtype of the arrays.
        new: (size, dtype) -> memory.
    """

    def __init__(self, dtype: npt.DTypeLike, new: New = np.empty) -> None:
        self._dtype, self._new = np.dtype(dtype), new
        self._memories: list[npt.NDArray[Any]] = []
        self._lock = Lock()

    def take(self, shape: tuple[int, ...]) -> npt.NDArray[Any]:
        """A contiguous array of this shape, with any values in it."""
        size = int(np.prod(shape))
        with self._lock:
            for n in range(len(self._memories)):
                if sys.getrefcount(self._memories[n]) == _FREE and self._memories[n].size >= size:
                    return self._memories[n][:size].reshape(shape)
            memory = self._new(size, self._dtype)
            others = self._memories[-_KEPT + 1 :] if memory.nbytes <= _LARGEST else []
            self._memories = [*others, memory]
        return memory[:size].reshape(shape)
