"""Streams in files, and images from streams, for Python."""

from __future__ import annotations

import os
from functools import cached_property
from operator import index
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Clock, Events, InputError, Intensities
from cosim.errors import quote
from cosim.files import write_events, write_stream
from cosim.files.event_file import ENDING, EventFile, read_events
from cosim.files.intensities import ENDING as INTENSITIES
from cosim.files.intensities import read_intensities, write_intensities
from cosim.spikes.ancillary import Ancillary
from cosim.spikes.viform import Sliceable, SpikeStream, Words
from scenarios.assemble.source.latched.dim import dim_of_run, registers_in, said_by_run
from scenarios.assemble.source.recording.opening import FASTEST
from scenarios.python.errors import in_python
from scenarios.python.frames import is_whole
from sensor.codec.files import open_any
from sensor.reconstruct import METHODS, isi, tau_levels
from sensor.reconstruct import reconstruct as image_of
from sensor.reconstruct.catalogue import TAU, check_ties
from sensor.reconstruct.intervals import Ties, interval_span

_UNLATCHED: Final = (f"stream{ENDING}", f"stream{INTENSITIES}")
"""Recordings of pixels without a latch in the folder of a run."""


class Stream(Sliceable):
    """A stream in a file, which is read where it is used. Its parts are in memory.

    Attributes:
        path: the file or folder.
        shape: (height, width) in pixels.
        cycles: number of latch cycles.
        clock: clock of the latches.
        notes: notes on the interpretation of the file.
        start: number of the first cycle.
    """

    def __init__(self, path: Path, size: tuple[int, int] | None = None) -> None:
        stream, notes = open_any(path, size)
        self._stream, self.path, self.notes = stream, path, tuple(notes)
        self.shape: tuple[int, int] = stream.shape
        self.cycles: int = stream.cycles
        self.clock: Clock = stream.clock
        self.start = int(getattr(stream, "start", 0))

    @cached_property
    def ancillary(self) -> tuple[Ancillary, ...]:
        """What the source says beyond the spikes: register writes and charges below threshold."""
        said = said_by_run(self.path)
        if said is not None:
            return said.told(self._stream)
        return tuple(getattr(self._stream, "ancillary", ()))

    def read_words(self, first: int, stop: int) -> Words:
        """Words `first` to `stop` (excluded), (n, H, W) uint32; see `SpikeStream`."""
        return self._stream.read_words(first, stop)


def path_of(given: Any) -> Path:
    """The path of a file or folder. Raises InputError for what is none."""
    if isinstance(given, (str, os.PathLike)):
        return Path(given)
    raise InputError("the path", "a text or a Path", quote(given), "name the file")


@in_python
def open_stream(
    path: str | os.PathLike[str], size: tuple[int, int] | None = None
) -> Stream | Any:  # fmt: skip
    """Opens a stream of any format that `viform convert` reads, or the one of a run's folder.

    Args:
        path: the file or folder.
        size: (width, height) for formats without a header.

    Returns:
        The stream, read where it is used. In memory: `Events` of pixels without a latch, whose
        ticks are too short for planes, and `Intensities`.

    Raises:
        InputError: there is no such stream, or it cannot be read.
    """
    place = path_of(path)
    given: Any = size
    try:
        pair = None if given is None else tuple(map(index, given))
    except TypeError:
        pair = ()
    if pair is not None and (len(pair) != 2 or min(pair) < 1):
        raise InputError(
            "size", "(width, height) in whole pixels", quote(given), "write size=(400, 250)"
        )
    if pair is None:
        kept = next((p for p in map(place.joinpath, _UNLATCHED) if p.exists()), place)
        name = kept.name.lower() if kept.is_file() else ""
        if name.endswith(INTENSITIES):
            return read_intensities(kept)
        if name.endswith(ENDING) and EventFile(kept).clock.hz > FASTEST:
            return read_events(kept)
    return Stream(place, pair)


def as_stream(given: Any) -> SpikeStream:
    """A stream as it is, or the one of a path. Raises InputError for anything else."""
    if isinstance(given, (str, os.PathLike)):
        return Stream(Path(given))
    if not (hasattr(given, "read_words") and hasattr(given, "cycles")):
        raise InputError(
            "the stream", "a Viform, a Stream or a path", type(given).__name__,
            "make one of planes (T, H, W): Viform.from_planes(planes, Clock(40_000))",
        )  # fmt: skip
    stream: SpikeStream = given
    return stream


@in_python
def save_stream(
    stream: SpikeStream | Events | Intensities, path: str | os.PathLike[str]
) -> list[str]:
    """Writes a stream in the format of the name's ending: .npz, .zarr, .dat, .raw, .events.npz;
    events as .events.npz, and intensities as .intensities.npz. An existing file is replaced, once
    the new one is complete.

    Returns:
        A line for each property of the stream that the format cannot hold.

    Raises:
        InputError: another ending, or the file cannot be written.
    """
    place = path_of(path)
    if not isinstance(stream, Events | Intensities):
        return write_stream(as_stream(stream), place)
    ending = ENDING if isinstance(stream, Events) else INTENSITIES
    if not place.name.lower().endswith(ending):
        raise InputError(
            "the path", f"a name that ends in {ending}", quote(str(path)), "change the ending"
        )
    if isinstance(stream, Events):
        write_events(stream, place)
    else:
        write_intensities(stream, place)
    return []


@in_python
def reconstruct(
    stream: SpikeStream | str | os.PathLike[str], at: int, method: str = "tfp", *,
    window: int | None = None, preceding: bool = False, ties: Ties = "before",
) -> npt.NDArray[np.float32]:  # fmt: skip
    """The image at an instant, as `viform image` makes it.

    Args:
        stream: the stream, or its path; one in a run's folder has its dim pixels by the run's
            readings.
        at: cycle of the instant, from 0.
        method: "tfp", "tfi", "tfstp", "motion-tfp", or "tau" (255 - tau).
        window: cycles; None for the default of the method.
        preceding: whether no spike after the instant is used.
        ties: interval that "tfi" and "tau" take of a pixel that fires at the instant: the one that
            this spike ends, "before", or the one that it begins, "after".

    Returns:
        (H, W) float32: spikes a cycle, of the nominal threshold if it is written in the stream;
        for tau, its levels from 0 to 255.

    Raises:
        InputError: another method, or an instant or window that the stream does not have.
    """
    opened = as_stream(stream)
    try:
        cycle = index(at)
    except TypeError:
        raise InputError("at", "the number of a cycle", quote(at), "round it") from None
    if window is not None and not is_whole(window):
        raise InputError("window", "a whole number of cycles", quote(window), "round it")
    names = (*METHODS, TAU)
    if method not in names:
        raise InputError("method", f"one of {', '.join(names)}", quote(method), "choose one")
    if method == TAU:
        check_ties(ties, method)
        span = interval_span(opened, cycle, window, preceding=preceding)
        return tau_levels(isi(opened, cycle, span, ties)).astype(np.float32)
    light = dim_of_run(opened.path) if isinstance(opened, Stream) else None
    registers = registers_in(opened, opened.path if isinstance(opened, Stream) else None)
    return image_of(
        opened, method, cycle, window, preceding=preceding, ties=ties, dim_light=light,
        registers=registers,
    ).rate  # fmt: skip
