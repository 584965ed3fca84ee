"""What of a stream a format has no place for, in lines to be said to who writes it."""

from __future__ import annotations

from pathlib import Path

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.config_yaml import CONFIG, config_beside
from cosim.files.dat import DAT_CLOCK, HEAD_SIZE
from cosim.files.dat_size import guess_size
from cosim.files.raw import RAW_CLOCK
from cosim.spikes.viform import SpikeStream

__all__ = ["losses"]

_CLOCKS: dict[str, Clock] = {".dat": DAT_CLOCK, ".raw": RAW_CLOCK}
"""Formats that hold spikes alone, and the clock they are read with."""


def losses(stream: SpikeStream, path: Path, ending: str, head: bool = False) -> list[str]:
    """One line for each thing that is lost when `stream` has been written to `path`."""
    if ending not in _CLOCKS:
        return []
    said = []
    clock, start = _CLOCKS[ending], int(getattr(stream, "start", 0))
    if stream.clock != clock:
        said.append(
            f"{path} does not keep the clock of {_hz(stream.clock)}: it is read as {_hz(clock)}"
        )
    if start:
        said.append(f"{path} does not keep that the first cycle is {start}: it is read as 0")
    if ending == ".dat" and (line := _size_lost(stream, path, head)):
        said.append(line)
    return said


def _size_lost(stream: SpikeStream, path: Path, head: bool) -> str | None:
    """Where a `.dat`, opened without --size, would be taken for one of another size."""
    height, width = stream.shape
    size = HEAD_SIZE if head else (width, height)
    beside = ""
    try:
        said = config_beside(path)
        read = said.size if said else guess_size(path, path.stat().st_size)[0]
        beside = f" and the {CONFIG} beside it says {read[0]}x{read[1]}" if said else ""
    except InputError:
        read = None
    if read == size:
        return None
    return f"{path} does not keep its size{beside}: read it with --size {size[0]}x{size[1]}"


def _hz(clock: Clock) -> str:
    return f"{clock.hz / 1000:.9g} kHz"
