"""A module in Verilator behind its shim, from its reset to its end."""

from __future__ import annotations

import ctypes
from pathlib import Path
from types import TracebackType
from typing import Any, Self


class VerilatedModule:
    """One instance of a library that `build.library` has built; a context that ends it.

    Subclasses declare the shim's other functions on `_library`, whose first argument is `_board`.

    Args:
        path: path of the library.
    """

    def __init__(self, path: Path) -> None:
        self._library: Any = ctypes.CDLL(str(path))
        self._library.viform_open.restype = ctypes.c_void_p
        self._library.viform_close.argtypes = [ctypes.c_void_p]
        self._board: int | None = self._library.viform_open()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        """Ends the model and completes its waveforms; may be called twice."""
        board, self._board = getattr(self, "_board", None), None
        if board is not None:
            self._library.viform_close(board)
