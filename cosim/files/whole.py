"""Writing so that nothing half-written looks whole: a temporary name first, the real one last."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cosim.errors import InputError

__all__ = ["whole"]


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A name beside `path` to write to, file or folder; it takes the place of `path` only when the
    block succeeds.

    Raises InputError where the system refuses to write, and where `path` is a folder of the user's
    own: only a Zarr store is replaced.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        _check(path)
        try:
            yield part
            if path.is_dir() and part.is_dir():
                shutil.rmtree(path)
            os.replace(part, path)
        finally:
            if part.is_dir():
                shutil.rmtree(part)
            else:
                part.unlink(missing_ok=True)
    except OSError as exc:
        raise InputError(
            f"{path}",
            "a name that can be written",
            f"refused ({exc.strerror or exc})",
            "choose another name, or make room",
        ) from exc


def _check(path: Path) -> None:
    if path.is_dir() and not (path / "zarr.json").is_file():
        raise InputError(f"{path}", "a new name", "a folder that is there", "choose another name")
    if not path.parent.is_dir():
        raise InputError(
            f"{path}", "in a folder that exists", f"in {path.parent}", f"mkdir -p {path.parent}"
        )
