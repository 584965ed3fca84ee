"""One way to open any stream and to write any: by its name's ending."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from cosim.errors import InputError
from cosim.files.config_yaml import CONFIG, Config, check_config, recording_of, write_config
from cosim.files.dat import HEAD_SIZE, pixels_of, write_dat
from cosim.files.dat_size import open_dat
from cosim.files.event_file import ENDING, write_events
from cosim.files.event_planes import EventStream
from cosim.files.losses import losses
from cosim.files.npz import read_npz, write_npz
from cosim.files.raw import RawStream, write_raw
from cosim.files.zarr_store import ZarrStream, write_zarr
from cosim.spikes.viform import SpikeStream

__all__ = ["FORMATS", "ending_of", "locate_stream", "notes_of", "open_stream", "write_stream"]


def _write_events(stream: SpikeStream, path: Path) -> None:
    """Events stay events: what planes do not keep of them goes along."""
    write_events(stream.file if isinstance(stream, EventStream) else stream, path)


_READ: dict[str, Callable[[Path], SpikeStream]] = {
    ".raw": RawStream,
    ".npz": read_npz,
    ".zarr": ZarrStream,
    ENDING: EventStream,
}
_WRITE: dict[str, Callable[[SpikeStream, Path], None]] = {
    ".raw": write_raw,
    ".npz": write_npz,
    ".zarr": write_zarr,
    ENDING: _write_events,
}
FORMATS = (".dat", *_READ)
"""Endings of stream files."""


def ending_of(path: Path) -> str:
    """The ending that tells a file's format, in lower case."""
    return ENDING if path.name.lower().endswith(ENDING) else path.suffix.lower()


def notes_of(stream: SpikeStream) -> tuple[str, ...]:
    """What the user should know about how the file was understood, a line each."""
    return tuple(getattr(stream, "notes", ()))


def locate_stream(path: Path) -> Path:
    """The file or store that is read when `path` is opened; InputError where there is none."""
    with _readable(path):
        return _located(path)[0]


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Says in one line what the system refuses to read."""
    try:
        yield
    except OSError as exc:
        raise InputError("the stream", "readable", f"{path} ({exc.strerror})", "check it") from exc


def _located(path: Path) -> tuple[Path, Config | None]:
    """The stream that a folder or a config.yaml stands for, or the path itself."""
    if (path / "stream.zarr").exists():
        return path / "stream.zarr", None
    if (path / "stream.events.npz").exists():
        raise InputError(
            "the stream", "of a run with a latch clock", f"{path}, whose pixels are asynchronous",
            "name the stream.events.npz in it; its cycles are ticks of sensor.asynchronous.timing",
        )  # fmt: skip
    if not path.exists():
        raise InputError("the stream", "a file that exists", str(path), "check the path")
    if path.suffix.lower() in (".yaml", ".yml") or (
        ending_of(path) not in FORMATS and (path / CONFIG).is_file()
    ):
        return recording_of(path)
    return path, None


def open_stream(path: Path, size: tuple[int, int] | None = None) -> SpikeStream:
    """Opens a stream; the folder of a run stands for the stream.zarr in it, a config.yaml and its
    folder for the recording that it names.

    size: (width, height) of formats without a header, as it is stored; one that has a header must
    agree. Raises InputError for whatever is no stream.
    """
    with _readable(path):
        path, config = _located(path)
        ending = ending_of(path)
        if ending not in FORMATS:
            raise InputError(
                "the stream",
                f"a {', '.join(FORMATS)} or the folder of a run",
                str(path),
                "rename or convert it",
            )
        stream = open_dat(path, size, config) if ending == ".dat" else _READ[ending](path)
    height, width = stream.shape
    if size is not None and (width, height) != (pixels_of(size) if ending == ".dat" else size):
        raise InputError(
            "--size", f"{width}x{height} for {path}", f"{size[0]}x{size[1]}", "leave it out"
        )
    return stream


def write_stream(
    stream: SpikeStream, path: Path, *, head: bool = False, config: bool = False
) -> list[str]:
    """Writes a stream in the format of the name's ending. Returns a line for each property of the
    stream that the format cannot hold.

    Args:
        stream: that is written.
        path: of the file.
        head: whether a `.dat` has frames of 416 x 250, with a head.
        config: whether a config.yaml is written beside a `.dat`.
    """
    ending = ending_of(path)
    if ending not in FORMATS:
        raise InputError(
            "the output",
            f"a name ending in {', '.join(FORMATS)}",
            str(path),
            "give it one of these",
        )
    if ending == ".dat":
        size = HEAD_SIZE if head else stream.shape[::-1]
        if config:
            check_config(path, size)
        write_dat(stream, path, head)
        if config:
            write_config(path, size)
    elif head or config:
        flag = "--head" if head else "--config"
        raise InputError(flag, "given with a .dat to write", str(path), f"leave {flag} out")
    else:
        _WRITE[ending](stream, path)
    return losses(stream, path, ending, head)
