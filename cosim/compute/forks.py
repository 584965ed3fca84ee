"""Processes beside this one: what a fork of it has lost, and the command of a child of Python.

A fork copies the memory of OpenCL and OpenGL, but not their threads. The copy waits for them for
ever: PoCL and Mesa hang. Neither has a way to begin anew. So a forked process is refused what its
parent has used before; it may do all else, such as read data sets and reconstruct images. A child
is begun anew, and finds the same modules as this process.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, Final
from weakref import WeakKeyDictionary

from cosim.errors import InputError

_HERE: Final[set[str]] = set()
_BEFORE: Final[set[str]] = set()
"""Libraries that this process has used, and those that its parents had when they forked it."""
_OWNERS: Final[WeakKeyDictionary[object, tuple[str, ...]]] = WeakKeyDictionary()
_LOST: Final[list[Any]] = []
_PACKAGES: Final = str(Path(__file__).resolve().parents[2])


def use(library: str) -> None:
    """States that this process uses the threads of a library.

    Raises:
        InputError: it was forked from a process that has used them.
    """
    if library in _BEFORE:
        raise InputError(
            "a process that simulates", "one that was spawned",
            f"forked from one that has used {library}, whose threads a fork does not copy",
            'start it by multiprocessing.get_context("spawn"), that of a DataLoader by '
            'multiprocessing_context="spawn"',
        )  # fmt: skip
    _HERE.add(library)


def lose_in_forks(owner: object, *names: str) -> None:
    """Removes attributes of an object in processes that are forked later. Their values are not
    released there, because that may hang as well."""
    _OWNERS[owner] = names


def _forked() -> None:
    _BEFORE.update(_HERE)
    _HERE.clear()
    for owner, names in _OWNERS.items():
        _LOST.append([owner.__dict__.pop(name, None) for name in names])


os.register_at_fork(after_in_child=_forked)


def python_child(code: str, *words: str) -> list[str]:
    """The command of a Python process that runs `code`, with `words` as its arguments.

    It finds our packages where they are, and other modules where this process finds them. By
    default Python would look first in the working folder, where a file of the user may have the
    name of any module.
    """
    places = [_PACKAGES, *(place for place in sys.path if isinstance(place, str))]  # as imports do
    found = f"import sys; sys.path[:] = {places!r}\n"
    return [sys.executable, "-c", found + code, *words]
