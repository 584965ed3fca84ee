"""One way to open any stream and to write any: by its name's ending."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cosim.errors import InputError
from cosim.files.dat import DatStream, write_dat
from cosim.files.npz import read_npz, write_npz
from cosim.files.zarr_store import ZarrStream, write_zarr
from cosim.viform import SpikeStream

__all__ = ["FORMATS", "open_stream", "write_stream"]

_READ: dict[str, Callable[[Path, tuple[int, int] | None], SpikeStream]] = {
    ".dat": DatStream,
    ".npz": lambda path, _: read_npz(path),
    ".zarr": lambda path, _: ZarrStream(path),
}
_WRITE: dict[str, Callable[[SpikeStream, Path], None]] = {
    ".dat": write_dat,
    ".npz": write_npz,
    ".zarr": write_zarr,
}
FORMATS = tuple(_READ)
"""Endings of stream files."""


def open_stream(path: Path, size: tuple[int, int] | None = None) -> SpikeStream:
    """Opens a stream; the folder of a run stands for the stream.zarr in it.

    size: (width, height) of formats without a header; one that has a header must agree.
    Raises InputError for whatever is no stream.
    """
    try:
        if (path / "stream.zarr").exists():
            path = path / "stream.zarr"
        if not path.exists():
            raise InputError("the stream", "a file that exists", str(path), "check the path")
        reader = _READ.get(path.suffix.lower())
        if reader is None:
            raise InputError(
                "the stream",
                f"a {', '.join(FORMATS)} or the folder of a run",
                str(path),
                "rename or convert it",
            )
        stream = reader(path, size)
    except OSError as exc:
        raise InputError("the stream", "readable", f"{path} ({exc.strerror})", "check it") from exc
    height, width = stream.shape
    if size is not None and size != (width, height):
        raise InputError(
            "--size", f"{width}x{height} for {path}", f"{size[0]}x{size[1]}", "leave it out"
        )
    return stream


def write_stream(stream: SpikeStream, path: Path) -> None:
    """Writes a stream in the format of the name's ending."""
    writer = _WRITE.get(path.suffix.lower())
    if writer is None:
        raise InputError(
            "the output", f"a name ending in {', '.join(_WRITE)}", str(path), "give it one of these"
        )
    writer(stream, path)
