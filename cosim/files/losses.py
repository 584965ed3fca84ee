"""Properties of a stream that a format cannot hold, as notes for the user."""

from __future__ import annotations

from pathlib import Path

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.config_yaml import CONFIG, adjacent_config
from cosim.files.dat import DAT_CLOCK, HEAD_SIZE
from cosim.files.dat_size import guess_size
from cosim.files.raw import RAW_CLOCK
from cosim.spikes.viform import SpikeStream

_CLOCKS: dict[str, Clock] = {".dat": DAT_CLOCK, ".raw": RAW_CLOCK}
"""Formats that hold only spikes, and the clock with which they are read."""


def losses(stream: SpikeStream, path: Path, ending: str, head: bool = False) -> list[str]:
    """One line for each property that is lost in writing `stream` to `path`."""
    if ending not in _CLOCKS:
        return []
    notes = []
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
