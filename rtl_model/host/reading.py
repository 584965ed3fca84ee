"""A reading of the charges: passes of `sensor_reading`, captured like a burst.

Pass j of a reading in N levels has a 1 where the charge is at least j Q / N, so the number of ones
of a pixel is its level, and no pixel may have a 1 behind a 0.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.host.board import Board
from rtl_model.host.capture import SETTINGS, Captured, burst, stop
from rtl_model.host.faults import Cause, LineFault

LEVELS: Final = tuple(1 << n for n in range(1, 8))
"""Levels that a reading may have."""

_SINCE: Final = 2  # minor version of the register map


class Reading(NamedTuple):
    """A reading.

    Attributes:
        level: floor(levels charge / Q), at most levels - 1; (rows, columns) uint16, 0 outside the
            window.
        levels: number of levels of the reading.
        frames: number of frames since the clear, of which the charges are.
        captured: the passes.
    """

    level: npt.NDArray[np.uint16]
    levels: int
    frames: int
    captured: Captured


def check_levels(levels: int, name: str) -> None:
    """Raises InputError for levels that no reading has. name: of the value, for the message."""
    if levels not in LEVELS:
        raise InputError(name, ", ".join(map(str, LEVELS)), str(levels), "give one of these")


def read_charges(board: Board, levels: int) -> Reading:
    """Takes a reading. A running sensor waits for it, and goes on with the same charges.

    Args:
        board: a Viform board.
        levels: one of `LEVELS`.

    Raises:
        InputError: for other levels, more than the board has memory for, or a capture of the sink.
        LineFault: for a board without readings, passes that contradict each other, and as `burst`.
    """
    check_levels(levels, "the levels of a reading")
    info = board.info()
    if info.version & 0xFFFF < _SINCE:
        raise LineFault(
            Cause.NOT_OURS,
            f"the board's register map is version 1.{info.version & 0xFFFF}, and readings "
            f"came with 1.{_SINCE}",
        )
    settings = {name: board.read_twice(name) for name in SETTINGS}
    if settings["capture_source"]:
        raise InputError(
            "capture_source", "0, the pixels, for a reading", "1", "set capture_source=0"
        )
    ran = board.read_twice("sensor_run")
    if ran:
        stop(board, info, settings)
    try:
        frames = board.read_twice("sensor_frames")
        captured = burst(board, levels - 1, reading=levels.bit_length() - 1)
    finally:
        if ran:
            board.write("sensor_run", 1)
    if captured.frames[0] != 1:
        raise LineFault(
            Cause.MISPLACED,
            f"the first captured pass of the reading is number {captured.frames[0]}, not 1",
        )
    rises = captured.planes[1:] & ~captured.planes[:-1]
    if rises.any():
        step, row, column = (int(place[0]) for place in np.nonzero(rises))
        raise LineFault(
            Cause.MISPLACED,
            f"row {row}, column {column} is below step {step + 1} of the reading, and not below "
            f"step {step + 2}",
        )
    return Reading(captured.planes.sum(axis=0, dtype=np.uint16), levels, frames, captured)
