"""Reading numpy's archives (`.npz`) with every byte of them checked."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["load_arrays"]

_ENTRY = 46
"""Bytes of the shortest entry in an archive's directory (APPNOTE.TXT, section 4.3.12). One whose
comment has a damaged length swallows the next, which zipfile does not notice."""


def load_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an `.npz` by name.

    numpy.load compares a checksum only when an array happens to end where its member does, so a
    damaged shape can go unseen. Raises OSError when the file cannot be read, ValueError when it is
    no archive, is damaged, or holds pickled objects or anything but arrays.
    """
    arrays: dict[str, npt.NDArray[Any]] = {}
    with path.open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                if not archive.infolist():
                    raise ValueError("it holds no arrays")
                for info in archive.infolist():
                    name = info.filename.removesuffix(".npy")
                    if name == info.filename:
                        raise ValueError(f"{name} is no array")
                    if len(info.comment) >= _ENTRY:
                        raise ValueError(f"{info.filename} may hide another member")
                    with archive.open(info) as member:
                        arrays[name] = np.lib.format.read_array(member, allow_pickle=False)
                        if member.read(1):  # at a member's end zipfile compares its checksum
                            raise ValueError(f"{info.filename} is longer than its array")
        except Exception as exc:  # zipfile, zlib and numpy raise a dozen types for damaged bytes
            raise ValueError(str(exc) or type(exc).__name__) from exc
    return arrays
