"""Archives of numpy (`.npz`): reading with all checksums verified, and access in parts."""

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
"""Bytes of the shortest entry in an archive's directory (APPNOTE.TXT, section 4.3.12). An entry
with a damaged comment length hides the next one, which zipfile does not notice."""


def _members(archive: zipfile.ZipFile) -> Iterator[tuple[str, zipfile.ZipInfo]]:
    """Arrays of an archive by name. Raises ValueError if it holds none, or anything else."""
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
    """Raises ValueError for the many exceptions of zipfile, zlib and numpy for damaged data, and
    suppresses the warnings of numpy about headers."""
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except Exception as exc:
        raise ValueError(shorten(str(exc)) or type(exc).__name__) from exc


def _must_end(member: IO[bytes], name: str) -> None:
    """Raises ValueError unless a member ends here."""
    if member.read(1):  # zipfile compares the checksum at the end of a member
        raise ValueError(f"{name}.npy is longer than its array")


def load_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an `.npz` by name.

    numpy.load compares a checksum only if the array ends where its member ends, so it may not
    notice a damaged shape.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is no archive, is damaged, or holds anything but arrays of numbers.
    """
    arrays: dict[str, npt.NDArray[Any]] = {}
    with path.open("rb") as file, _as_value_error(), zipfile.ZipFile(file) as archive:
        for name, info in _members(archive):
            with archive.open(info) as member:
                arrays[name] = np.lib.format.read_array(member, allow_pickle=False)
                _must_end(member, name)
    return arrays


class ArrayReader:
    """One array of an archive, which is read from its first element in parts of any size.

    Attributes:
        dtype, shape: from its header. Memory is allocated only for the parts that are read.
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
        """The next `count` elements, or all that remain, flat. Raises ValueError for damaged
        data."""
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
    """The arrays of an `.npz` by name, for reading in parts, in any interleaving.

    The checksum of an array is compared when its last element is read. Raises as `load_arrays`
    does.
    """
    with path.open("rb") as file:
        with _as_value_error():
            archive = zipfile.ZipFile(file)
        with archive:
            with _as_value_error():
                readers = {n: ArrayReader(archive.open(i), n) for n, i in _members(archive)}
            yield readers


class ArchiveWriter:
    """Writes an `.npz` array by array, each whole or in parts. level: of compression, 0 to 9."""

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
        """Writes an array from consecutive parts in C order.

        Raises ValueError if the parts do not add up to the shape.
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
