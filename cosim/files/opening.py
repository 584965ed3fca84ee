"""Opening and writing of streams in all formats, by the ending of the name, with notes on what a
format cannot hold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.config_yaml import (
    CONFIG,
    Config,
    adjacent_config,
    check_config,
    recording_of,
    write_config,
)
from cosim.files.dat import DAT_CLOCK, HEAD_SIZE, guess_size, open_dat, pixels_of, write_dat
from cosim.files.event_file import ENDING, write_events
from cosim.files.event_planes import EventStream
from cosim.files.intensities import ENDING as INTENSITIES
from cosim.files.npz import read_npz, write_npz
from cosim.files.plane_order import DAT_ORDER, PlaneOrder
from cosim.files.raw import RAW_CLOCK, RawStream, write_raw
from cosim.files.recorder import write_zarr
from cosim.files.zarr_store import ZarrStream
from cosim.spikes.viform import SpikeStream

_READ: dict[str, Callable[[Path], SpikeStream]] = {
    ".raw": RawStream,
    ".npz": read_npz,
    ".zarr": ZarrStream,
    ENDING: EventStream,
}
FORMATS = (".dat", *_READ)
"""Endings of stream files."""
_CLOCKS: dict[str, Clock] = {".dat": DAT_CLOCK, ".raw": RAW_CLOCK}
"""Formats that hold only spikes, and the clock with which they are read."""


def open_stream(
    path: Path, size: tuple[int, int] | None = None, order: PlaneOrder = DAT_ORDER
) -> SpikeStream:
    """Opens a stream.

    Args:
        path: a file, the folder of a run for its stream.zarr, or a config.yaml or its folder for
            the recording that it names.
        size: stored (width, height), for formats without a header. It must agree with a header.
        order: order of bits, bytes and rows, for a `.dat` alone.

    Raises:
        InputError: there is no such stream.
    """
    with _readable(path):
        path, config = _located(path)
        ending = ending_of(path)
        if ending not in FORMATS and (path / "result.json").exists():
            frames = (path / "frames.zarr").exists()
            raise InputError(
                "the run", "one with stream.zarr", f"{path}, a run of frames" if frames
                else f"{path}, which has none",
                "name the run of a spike camera" if frames
                else "run it again without --store none",
            )  # fmt: skip
        if ending not in FORMATS:
            raise InputError(
                "the stream",
                f"a {', '.join(FORMATS)} or the folder of a run",
                f"{path}, a folder without a stream" if path.is_dir() else str(path),
                "name a file in it" if path.is_dir() else "rename or convert it",
            )
        if order != DAT_ORDER and ending != ".dat":
            raise InputError(
                "the order of bits, bytes and rows", "given with a .dat", f"given with {path}",
                "leave it out: the format tells it",
            )  # fmt: skip
        dat = ending == ".dat"
        stream = open_dat(path, size, config, order) if dat else _READ[ending](path)
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
        stream: the stream.
        path: the file.
        head: whether a `.dat` has frames of 416 x 250, with a head.
        config: whether a config.yaml is written next to a `.dat`.
    """
    ending = ending_of(path)
    if ending not in FORMATS or path.name.lower().endswith(INTENSITIES):
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


def locate_stream(path: Path) -> Path:
    """The file or store that `open_stream` reads. Raises InputError if there is none."""
    with _readable(path):
        return _located(path)[0]


def ending_of(path: Path) -> str:
    """The ending that determines the format of a file, in lower case."""
    return ENDING if path.name.lower().endswith(ENDING) else path.suffix.lower()


def notes_of(stream: SpikeStream) -> tuple[str, ...]:
    """Notes for the user about the interpretation of a file."""
    return tuple(getattr(stream, "notes", ()))


def _write_events(stream: SpikeStream, path: Path) -> None:
    """Writes events; those of an event file keep properties that planes do not hold."""
    write_events(stream.file if isinstance(stream, EventStream) else stream, path)


_WRITE: dict[str, Callable[[SpikeStream, Path], None]] = {
    ".raw": write_raw,
    ".npz": write_npz,
    ".zarr": write_zarr,
    ENDING: _write_events,
}


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Turns an OSError into an InputError."""
    try:
        yield
    except OSError as exc:
        raise InputError("the stream", "readable", f"{path} ({exc.strerror})", "check it") from exc


def _located(path: Path) -> tuple[Path, Config | None]:
    """The stream of a folder or of a config.yaml, or the path itself."""
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


def losses(stream: SpikeStream, path: Path, ending: str, head: bool = False) -> list[str]:
    """One line for each property that is lost in writing `stream` to `path`."""
    notes = []
    said: Any = getattr(stream, "ancillary", None)
    if ending not in (".npz", ".vfl") and said:
        notes.append(
            f"{path} does not keep what the chip says beyond its spikes (register writes, charges "
            "below threshold): an .npz and a .vfl do"
        )
    if ending not in _CLOCKS:
        return notes
    clock, start = _CLOCKS[ending], int(getattr(stream, "start", 0))
    if stream.clock != clock:
        notes.append(
            f"{path} does not keep the clock of {_hz(stream.clock)}: it is read as {_hz(clock)}"
        )
    if start:
        notes.append(f"{path} does not keep that the first cycle is {start}: it is read as 0")
    if ending == ".dat" and (line := _size_lost(stream, path, head)):
        notes.append(line)
    return notes


def _size_lost(stream: SpikeStream, path: Path, head: bool) -> str | None:
    """A note if a `.dat` would be read with another size without --size; None otherwise."""
    height, width = stream.shape
    size = HEAD_SIZE if head else (width, height)
    stated = ""
    try:
        config = adjacent_config(path)
        read = config.size if config else guess_size(path, path.stat().st_size)[0]
        stated = f" and the {CONFIG} beside it says {read[0]}x{read[1]}" if config else ""
    except InputError:
        read = None
    if read == size:
        return None
    return f"{path} does not keep its size{stated}: read it with --size {size[0]}x{size[1]}"


def _hz(clock: Clock) -> str:
    return f"{clock.hz / 1000:.9g} kHz"
