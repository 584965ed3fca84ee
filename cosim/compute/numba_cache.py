"""The cache of numba on a disk that takes no more, or with files that are damaged.

numba raises what a write of its cache raises, and the run would end although its function is
compiled: here such a function is used and not kept. A file of no bytes, or one that is cut, raises
what `pickle` raises (EOFError, UnpicklingError), and one with other content is executed: here each
file ends with the SHA-256 of what stands before, and one without it is compiled again.

numba has no option for this. But it calls the entry point "init" of the group "numba_extensions"
before it compiles anything (numba's manual, "Registering extensions with entry points"). Ours in
`pyproject.toml` is `tolerate`; so nothing imports numba before it is needed.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from cosim.compute.compiling import begin_compiling, end_compiling

__all__ = ["tolerate"]


def tolerate() -> None:
    """From now on, a compiled function that the disk does not take is not kept, and one that cannot
    be read from the disk is compiled again; and what is being compiled is counted."""
    # It would warn of a /dev/shm that cannot be written. The lock is for processes that are forked
    # while they compile (`forks`).
    warnings.filterwarnings("ignore", "Could not obtain multiprocessing lock")

    from numba.core import event
    from numba.core.caching import FunctionCache, IndexDataCacheFile

    class _Compiling(event.Listener):
        def on_start(self, event: Any) -> None:
            begin_compiling()

        def on_end(self, event: Any) -> None:
            end_compiling()

    event.register("numba:compile", _Compiling())
    keep, find = FunctionCache.save_overload, FunctionCache.load_overload
    write, read_index = IndexDataCacheFile._open_for_write, IndexDataCacheFile._load_index

    def save_overload(self: Any, sig: Any, data: Any) -> None:
        with suppress(OSError):
            keep(self, sig, data)

    def load_overload(self: Any, sig: Any, target_context: Any) -> Any:
        try:
            return find(self, sig, target_context)
        except MemoryError:
            raise
        except Exception:  # a whole file that names what no longer exists, or cannot be opened
            return None

    @contextmanager
    def _open_for_write(self: Any, path: str) -> Iterator[IO[bytes]]:
        with write(self, path) as file:
            yield file
            file.flush()
            file.write(hashlib.sha256(Path(file.name).read_bytes()).digest())

    def _load_index(self: Any) -> Any:
        # numba reads no further than it needs: the sum at the end is not seen. An index that names
        # no files is written anew.
        return read_index(self) if _is_whole(Path(self._index_path)) else {}

    def load(self: Any, key: Any) -> Any:
        name = self._load_index().get(key)
        if name is None or not _is_whole(Path(self._data_path(name))):
            return None
        return self._load_data(name)

    for owner, function in (
        (FunctionCache, save_overload), (FunctionCache, load_overload),
        (IndexDataCacheFile, load), (IndexDataCacheFile, _load_index),
        (IndexDataCacheFile, _open_for_write),
    ):  # fmt: skip
        setattr(owner, function.__name__, function)


def _is_whole(path: Path) -> bool:
    """Whether a file ends with the sum of what stands before."""
    try:
        data = path.read_bytes()
    except OSError:
        return False
    size = hashlib.sha256().digest_size
    return hashlib.sha256(data[:-size]).digest() == data[-size:]
