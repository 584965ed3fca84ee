"""The cache of numba: on a disk that takes no more, with files that are damaged, and after changes.

numba raises what a write of its cache raises, and the run would end although its function is
compiled: here such a function is used and not kept. A file of no bytes, or one that is cut, raises
what `pickle` raises (EOFError, UnpicklingError), and one with other content is executed: here each
file ends with the SHA-256 of what stands before, and one without it is compiled again.

numba compiles a function anew where its own file has changed, and not where another file has, from
which it takes a function or a constant: after an update it would go on with the old ones, without a
word. Here what a function takes from elsewhere is a part of the key under which it is kept.

numba imports all that it can compile, 250 modules, before it reads a function from the disk: .3 s
of each process. Code that is compiled needs none of them but the memory of arrays and the secret of
Python's hashes, whose addresses it names. Here they are imported when something is compiled.

numba compiles errors with long texts, and each function for a call from C: half and a tenth of the
time of some of ours. Here it leaves both out (`_compile_less`).

numba has no option for this. But it calls the entry point "init" of the group "numba_extensions"
before it compiles anything (numba's manual, "Registering extensions with entry points"). Ours in
`pyproject.toml` is `tolerate`; so nothing imports numba before it is needed.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import IO, Any, Final

import numpy as np

from cosim.compute.compiling import begin_compiling, end_compiling

_PACKAGES: Final = ("cosim", "display", "imagers", "link", "rtl_model", "scenarios", "sensor")


def tolerate() -> None:
    """From now on, a compiled function that the disk does not take is not kept, and one that cannot
    be read from the disk, or takes what has changed since, is compiled again; and what is being
    compiled is counted."""
    # It would warn of a /dev/shm that cannot be written. The lock is for processes that are forked
    # while they compile (`forks`).
    warnings.filterwarnings("ignore", "Could not obtain multiprocessing lock")

    from numba.core import event
    from numba.core.caching import FunctionCache, IndexDataCacheFile
    from numba.core.runtime import rtsys

    class _Compiling(event.Listener):
        def on_start(self, event: Any) -> None:
            begin_compiling()
            _compile_less()

        def on_end(self, event: Any) -> None:
            end_compiling()

    event.register("numba:compile", _Compiling())
    index_key = FunctionCache._index_key
    keep, find = FunctionCache.save_overload, FunctionCache._load_overload
    write, read_index = IndexDataCacheFile._open_for_write, IndexDataCacheFile._load_index

    def save_overload(self: Any, sig: Any, data: Any) -> None:
        with suppress(OSError):
            keep(self, sig, data)

    def load_overload(self: Any, sig: Any, target_context: Any) -> Any:
        try:
            rtsys.initialize(target_context)
            import_module("numba.cpython.hashing")
            return find(self, sig, target_context)
        except MemoryError:
            raise
        except Exception:  # a whole file that names what no longer exists, or cannot be opened
            return None

    def _index_key(self: Any, sig: Any, codegen: Any) -> Any:
        if not hasattr(self, "taken"):  # once; when a module is read, not all of it is there
            self.taken = taken(self._py_func)
        return *index_key(self, sig, codegen), self.taken

    @contextmanager
    def _open_for_write(self: Any, path: str) -> Iterator[IO[bytes]]:
        with write(self, path) as file:
            yield file
            file.flush()
            file.write(hashlib.sha256(Path(file.name).read_bytes()).digest())

    def _load_index(self: Any) -> Any:
        # numba reads no further than it needs: the sum at the end is not seen. An index that names
        # no files is written anew, and so is one with the type of a module that has moved since.
        try:
            return read_index(self) if _is_whole(Path(self._index_path)) else {}
        except MemoryError:
            raise
        except Exception:
            return {}

    def load(self: Any, key: Any) -> Any:
        name = self._load_index().get(key)
        if name is None or not _is_whole(Path(self._data_path(name))):
            return None
        return self._load_data(name)

    for owner, function in (
        (FunctionCache, save_overload), (FunctionCache, load_overload), (FunctionCache, _index_key),
        (IndexDataCacheFile, load), (IndexDataCacheFile, _load_index),
        (IndexDataCacheFile, _open_for_write),
    ):  # fmt: skip
        setattr(owner, function.__name__, function)


@cache
def _compile_less() -> None:
    """From now on, numba leaves out what no function of ours needs. Called when numba compiles: all
    that it compiles with is imported by then."""
    from numba.core.lowering import Lower
    from numba.np import arrayobj

    # Where an array is assigned to a slice of another shape, the text of the error contains both
    # shapes. To make it takes 3 s of compilation; the text for other targets is a constant.
    long, short = (
        getattr(arrayobj, f"ol_raise_with_shape_context_{target}") for target in ("cpu", "generic")
    )
    long.__code__ = short.__code__
    # A function is compiled for Python, for other compiled functions, and for C, which is a tenth
    # of the time. A user's own functions may be called from C.
    for_c = Lower.create_cfunc_wrapper

    def create_cfunc_wrapper(self: Any) -> None:
        if self.func_ir.func_id.modname.partition(".")[0] not in _PACKAGES:
            for_c(self)

    setattr(Lower, create_cfunc_wrapper.__name__, create_cfunc_wrapper)


def taken(function: FunctionType) -> str:
    """Digest of what a function takes from outside itself: the code of compiled functions that it
    calls, of those that these call, and the constants that they name."""
    digest, met = hashlib.sha256(), set[int]()

    def add_code(code: CodeType, names: dict[str, Any]) -> None:
        digest.update(code.co_code)
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                add_code(constant, names)
            else:
                digest.update(repr(constant).encode())
        for name in code.co_names:
            digest.update(name.encode())
            value = names.get(name)
            if isinstance(value, ModuleType):
                for attribute in code.co_names:
                    add_value(getattr(value, attribute, None))
            add_value(value)

    def add_value(value: Any) -> None:
        # Of a dispatcher of numba, and of a function that it compiles in place.
        inner = getattr(value, "py_func", None) or getattr(value, "_defn", None)
        if isinstance(inner, FunctionType):
            if id(inner) not in met:
                met.add(id(inner))
                add_code(inner.__code__, inner.__globals__)
        elif isinstance(value, np.ndarray):
            digest.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
        elif isinstance(value, tuple):
            for each in value:
                add_value(each)
        elif isinstance(value, bool | int | float | str | bytes | np.generic):
            digest.update(repr(value).encode())

    met.add(id(function))
    add_code(function.__code__, function.__globals__)
    return digest.hexdigest()


def _is_whole(path: Path) -> bool:
    """Whether a file ends with the sum of what stands before."""
    try:
        data = path.read_bytes()
    except OSError:
        return False
    size = hashlib.sha256().digest_size
    return hashlib.sha256(data[:-size]).digest() == data[-size:]
