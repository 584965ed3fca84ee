"""Archives of numpy (`.npz`): reading with all checksums verified, and access in parts.

A few megabytes unpack to a thousand times as much. So the headers of all arrays are read first, and
their sizes are compared with the free memory.
"""

from __future__ import annotations

import io
import struct
import warnings
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Final, cast

import numpy as np
import numpy.typing as npt

from cosim.compute.memory import check_memory
from cosim.errors import shorten

_ENTRY = 46
"""Bytes of the shortest entry in an archive's directory (APPNOTE.TXT, section 4.3.12). An entry
with a damaged comment length hides the next one, which zipfile does not notice."""
_LENGTH: Final = {(1, 0): struct.Struct("<H"), (2, 0): struct.Struct("<I")}
"""Length of an array's header, by the version of its format (numpy.lib.format)."""
_HEADER: Final = 10_000
"""Bytes of the longest header; numpy, too, parses no longer one, but reads it first."""
_TIMES: Final = 2
"""Arrays of a file may take one part in so many of the free memory: what is made of them takes as
much again."""


class _Plain:
    """A file that numpy does not know to be one: with its own call for files, `save` raises an
    OSError without a reason where the disk is full."""

    def __init__(self, file: IO[bytes]) -> None:
        self.write = file.write


def save_array(file: IO[bytes], array: npt.ArrayLike) -> None:
    """Writes an array as `.npy`. Raises OSError with its reason."""
    np.save(cast(Any, _Plain(file)), array, allow_pickle=False)


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
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{info.filename} is compressed by method {info.compress_type}")
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


def _header(member: IO[bytes], name: str) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether in Fortran order, and type of the array that a member begins with."""
    magic = member.read(np.lib.format.MAGIC_LEN)
    version = np.lib.format.read_magic(io.BytesIO(magic))
    if version not in _LENGTH:
        raise ValueError(f"{name}.npy is of format {version}")
    length = _LENGTH[version]
    stated = member.read(length.size)
    if len(stated) < length.size:
        raise ValueError(f"{name}.npy has no header")
    (size,) = length.unpack(stated)
    if size > _HEADER:
        raise ValueError(f"the header of {name}.npy is too large: {size} bytes")
    rest = io.BytesIO(stated + member.read(size))
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(rest)
    return np.lib.format.read_array_header_2_0(rest)


def _size(archive: zipfile.ZipFile) -> int:
    """Bytes of all arrays together, by their headers. Raises ValueError if a member is shorter than
    its header states."""
    total = 0
    for name, info in _members(archive):
        with archive.open(info) as member:
            shape, _, dtype = _header(member, name)
        size = int(np.prod(shape, dtype=object)) * dtype.itemsize
        if size > info.file_size:
            raise ValueError(f"{name}.npy is shorter than its array")
        total += size
    return total


def load_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an `.npz` by name.

    numpy.load compares a checksum only if the array ends where its member ends, so it may not
    notice a damaged shape.

    Raises:
        InputError: the arrays take more than half of the free memory; none has been unpacked.
        OSError: the file cannot be read.
        ValueError: the file is no archive, is damaged, or holds anything but arrays of numbers.
    """
    arrays: dict[str, npt.NDArray[Any]] = {}
    with path.open("rb") as file:
        with _as_value_error():
            archive = zipfile.ZipFile(file)
        with archive:
            with _as_value_error():
                size = _size(archive)
            check_memory(f"the arrays of {path}, twice,", _TIMES * size, "give a smaller file")
            with _as_value_error():
                for name, info in _members(archive):
                    with archive.open(info) as member:
                        arrays[name] = np.lib.format.read_array(member, allow_pickle=False)
                        _must_end(member, name)
    return arrays


class ArrayReader:
    """One array of an archive, which is read from its first element in parts of any size.

    Attributes:
        dtype, shape: dtype and shape of the array, from its header. Memory is allocated only for
            the parts that are read.
    """

    def __init__(self, member: IO[bytes], name: str) -> None:
        self._member, self._name, self._done = member, name, 0
        self.shape, fortran, self.dtype = _header(member, name)
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
