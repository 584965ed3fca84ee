"""Tables that take long to compute are kept between runs, in the cache folder.

A table is kept under the digest of its arguments, of the source files that compute it and of the
versions of numpy and scipy, so it is computed again whenever any of them has changed. A file that
was damaged or cannot be read is computed again too.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Callable, Mapping, Set
from contextlib import suppress
from dataclasses import fields, is_dataclass
from fractions import Fraction
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from cosim.compute.cache_folder import cache_folder

_Value = TypeVar("_Value")

_MOST: Final = 256
"""Number of files that are kept; beyond it the oldest are removed."""
_DIGEST: Final = 32
"""Bytes of a SHA-256 digest."""
_SOURCES: Final = {".py", ".cl", ".glsl"}
"""Endings of files with source code."""


def described(value: Any) -> str:
    """A text that two values share only if they are the same, as an argument of `cached_table`.

    Args:
        value: a number, a text, an array, a collection, a dataclass or an object without state, or
            any of these within each other.

    Raises:
        TypeError: another object.
    """
    if value is None or isinstance(value, str | bytes | int | float | Fraction | np.generic):
        return f"{type(value).__name__} {value!r}"
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return f"{value.dtype.str} {value.shape} {digest}"
    if isinstance(value, Mapping):
        value = [f"{described(key)}: {described(of)}" for key, of in value.items()]
        return f"{{{', '.join(sorted(value))}}}"
    if isinstance(value, Set):
        return f"{{{', '.join(sorted(map(described, value)))}}}"
    if isinstance(value, tuple | list):
        return f"({', '.join(map(described, value))})"
    kind = f"{type(value).__module__}.{type(value).__qualname__}"
    if is_dataclass(value):
        parts = {field.name: getattr(value, field.name) for field in fields(value)}
        return f"{kind}{described(parts)}"
    # A class in Python without state: not a function, which has no state of this form either.
    plain = getattr(type(value), "__new__", None) is object.__new__  # a function has its own
    slots = any(getattr(each, "__slots__", ()) for each in type(value).__mro__)
    if plain and not slots and getattr(value, "__dict__", None) == {}:
        return kind
    raise TypeError(f"a value must be described by its content, not {kind}")


@cache
def sources_of(*packages: str) -> tuple[str, ...]:
    """Paths of all source files of these packages."""
    folders = [Path(str(import_module(name).__file__)).parent for name in packages]
    found = (path for folder in folders for path in folder.rglob("*") if path.suffix in _SOURCES)
    return tuple(sorted(map(str, found)))


def cached_table(
    name: str, arguments: tuple[Any, ...], sources: tuple[str, ...],
    make: Callable[[], npt.NDArray[Any]],
) -> npt.NDArray[Any]:  # fmt: skip
    """The array that `make` computes, from an earlier run if there is one.

    Args:
        name: name of the table, for the name of its file.
        arguments: values on which the array depends; their text tells them apart. Bytes are
            allowed.
        sources: paths of the source files that compute it.
        make: computes it.
    """
    digest = hashlib.sha256(repr((arguments, version("numpy"), version("scipy"))).encode())
    for source in sources:
        digest.update(Path(source).read_bytes())
    path = cache_folder() / "tables" / f"{name}-{digest.hexdigest()[:40]}"
    found = _read(path)
    if found is None:
        found = make()
        with suppress(OSError):  # a full disk, or another user's folder
            _write(path, found)
    return found


def cached_value(
    name: str, arguments: Any, packages: tuple[str, ...], kind: Any, make: Callable[[], _Value]
) -> _Value:
    """As `cached_table` for a value of numbers and texts in dataclasses and tuples, computed by
    compiled loops, whose sums may differ between processors.

    Args:
        name: name of the value, for that of its file.
        arguments: value on which it depends, see `described`; one that is made in each run if they
            cannot be described.
        packages: whose source files compute it.
        kind: its type, with which pydantic reads it.
        make: computes it.
    """
    from llvmlite.binding import get_host_cpu_name  # takes long to import, as pydantic does
    from pydantic import TypeAdapter

    try:
        text = described(arguments)
    except TypeError:
        return make()
    form: Any = TypeAdapter(kind)
    made: list[_Value] = []

    def packed() -> npt.NDArray[np.uint8]:
        made.append(make())
        return np.frombuffer(json.dumps(form.dump_python(made[0])).encode(), np.uint8)

    own = text, get_host_cpu_name(), version("numba")
    found = cached_table(name, own, sources_of(*packages), packed)
    value: _Value = made[0] if made else form.validate_python(json.loads(found.tobytes()))
    return value


def _read(path: Path) -> npt.NDArray[Any] | None:
    """The array of a file; None if there is none, or it is damaged."""
    with suppress(OSError, ValueError, EOFError):
        data = path.read_bytes()
        if hashlib.sha256(data[_DIGEST:]).digest() == data[:_DIGEST]:
            array: npt.NDArray[Any] = np.load(io.BytesIO(data[_DIGEST:]), allow_pickle=False)
            return array
    return None


def _write(path: Path, array: npt.NDArray[Any]) -> None:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    data = buffer.getvalue()
    path.parent.mkdir(exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        part.write_bytes(hashlib.sha256(data).digest() + data)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    files = sorted(path.parent.iterdir(), key=lambda file: file.stat().st_mtime)
    for old in files[:-_MOST]:
        old.unlink(missing_ok=True)
