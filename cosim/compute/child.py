"""Child processes of Python that find the same modules as this process."""

from __future__ import annotations

import sys
from pathlib import Path

_HERE = str(Path(__file__).resolve().parents[2])


def python_child(code: str, *words: str) -> list[str]:
    """The command of a Python process that runs `code`, with `words` as its arguments.

    It finds our packages where they are, and other modules where this process finds them. By
    default Python would look first in the working folder, where a file of the user may have the
    name of any module.
    """
    places = [_HERE, *(place for place in sys.path if isinstance(place, str))]  # as imports do
    found = f"import sys; sys.path[:] = {places!r}\n"
    return [sys.executable, "-c", found + code, *words]
