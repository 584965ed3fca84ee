"""numpy's archives (`.npz`): read with every byte checked, read and written in parts."""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from cosim.errors import shorten

__all__ = ["ArchiveWriter", "ArrayReader", "load_arrays", "open_arrays"]

_ENTRY = 46
"""Bytes of the shortest entry in an archive's directory (APPNOTE.TXT, section 4.3.12). One whose
comment has a damaged length swallows the next, which zipfile does not notice."""


def _members(archive: zipfile.ZipFile) -> Iterator[tuple[str, zipfile.ZipInfo]]:
    """The arrays of an archive by name; ValueError where it holds none or anything else."""
    if not archive.infolist():
        raise ValueError("it holds no arrays")
    for info in archive.infolist():
        name = info.filename.removesuffix(".npy")
        if name == info.filename:
            raise ValueError(f"{name} is no array")
        if len(info.comment) >= _ENTRY:
            raise ValueError(f"{info.filename} may hide another member")
        yield name, info


@contextmanager
def _as_value_error() -> Iterator[None]:
    """zipfile, zlib and numpy raise a dozen types for damaged bytes, and numpy warns of headers."""
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except Exception as exc:
        raise ValueError(shorten(str(exc)) or type(exc).__name__) from exc


def _must_end(member: IO[bytes], name: str) -> None:
    if member.read(1):  # at a member's end zipfile compares its checksum
        raise ValueError(f"{name}.npy is longer than its array")


def load_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an `.npz` by name.

    numpy.load compares a checksum only when an array happens to end where its member does, so a
    damaged shape can go unseen. Raises OSError when the file cannot be read, ValueError when it is
    no archive, is damaged, or holds pickled objects or anything but arrays.
    """
    arrays: dict[str, npt.NDArray[Any]] = {}
    with path.open("rb") as file, _as_value_error(), zipfile.ZipFile(file) as archive:
        for name, info in _members(archive):
            with archive.open(info) as member:
                arrays[name] = np.lib.format.read_array(member, allow_pickle=False)
                _must_end(member, name)
    return arrays


class ArrayReader:
    """One array of an archive, read from its first element on in parts of any size.

    dtype, shape: what its header says; nothing is allocated for it before it is read.
    """

    def __init__(self, member: IO[bytes], name: str) -> None:
        self._member, self._name, self._done = member, name, 0
        version = np.lib.format.read_magic(member)
        if version == (1, 0):
            header = np.lib.format.read_array_header_1_0(member)
        elif version == (2, 0):
            header = np.lib.format.read_array_header_2_0(member)
        else:
            raise ValueError(f"{name}.npy is of format {version}")
        self.shape, fortran, self.dtype = header
        if self.dtype.hasobject or (fortran and len(self.shape) > 1):
            raise ValueError(f"{name}.npy must hold numbers in C order")

    def read(self, count: int) -> npt.NDArray[Any]:
        """The next `count` elements, flat, or those that are left; ValueError for damage."""
        with _as_value_error():
            total = int(np.prod(self.shape, dtype=object))
            count = min(count, total - self._done)
            data = self._member.read(count * self.dtype.itemsize)
            if len(data) != count * self.dtype.itemsize:
                raise ValueError(f"{self._name}.npy is shorter than its array")
            self._done += count
            if self._done == total:
                _must_end(self._member, self._name)
            return np.frombuffer(data, self.dtype)


@contextmanager
def open_arrays(path: Path) -> Iterator[dict[str, ArrayReader]]:
    """The arrays of an `.npz` by name, to be read in parts, side by side.

    An array's checksum is compared when its last element is read. Raises as `load_arrays` does.
    """
    with path.open("rb") as file:
        with _as_value_error():
            archive = zipfile.ZipFile(file)
        with archive:
            with _as_value_error():
                readers = {n: ArrayReader(archive.open(i), n) for n, i in _members(archive)}
            yield readers


class ArchiveWriter:
    """Writes an `.npz` array by array, each whole or in parts. level: of zlib, 0 to 9."""

    def __init__(self, file: IO[bytes], level: int = 6) -> None:
        self._zip = zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=level)

    def __enter__(self) -> ArchiveWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._zip.close()

    def write(self, name: str, array: npt.ArrayLike) -> None:
        """Writes a whole array."""
        values = np.asarray(array)
        self.write_parts(name, values.dtype, values.shape, [values])

    def write_parts(
        self,
        name: str,
        dtype: npt.DTypeLike,
        shape: tuple[int, ...],
        parts: Iterable[npt.NDArray[Any]],
    ) -> None:
        """Writes an array of that type and shape from parts that follow each other in C order.

        Raises ValueError where they do not add up to it.
        """
        kind, done = np.dtype(dtype), 0
        header = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False}
        with self._zip.open(f"{name}.npy", "w", force_zip64=True) as member:
            np.lib.format.write_array_header_1_0(member, {**header, "shape": shape})
            for part in parts:
                member.write(np.ascontiguousarray(part, kind).tobytes())
                done += part.size
        if done != int(np.prod(shape, dtype=object)):
            raise ValueError(f"{name} of shape {shape} got {done} elements")
