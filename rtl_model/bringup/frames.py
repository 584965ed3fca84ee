"""Frames of a board: their clock, and a burst held against the cycle model."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import numpy.typing as npt

from cosim import Clock
from rtl_model.bringup import Burst, compare
from rtl_model.geometry import Geometry
from rtl_model.host import Board, Captured, capture

__all__ = ["clock_of", "compared", "pattern_of", "uploaded_image"]


def clock_of(board: Board) -> Clock:
    """The clock of a board's frames as its registers have it: nominal clock over the tick's."""
    info = board.info()
    tick = max(board.read_twice("sensor_tick_clocks"), board.read_twice("sensor_tick_minimum"))
    exact = Fraction(info.clock_hz, tick << board.read_twice("sensor_clock_select"))
    return Clock(exact.numerator, exact.denominator)


def pattern_of(board: Board) -> npt.NDArray[np.uint8]:
    """The pattern memory's (rows, columns) uint8, read until two readings agree."""
    size = board.info().geometry
    words = board.bone.read_twice(board.csr.base("pattern_mem"), size.pattern_bytes // 4)
    wide = np.array(words, "<u4").view(np.uint8).reshape(size.rows, -1)
    return wide[:, : size.columns]


def compared(board: Board, frames: int) -> tuple[Captured, Burst]:
    """A burst under the registers as they are, from frame 0 and no charge, beside the cycle
    model's planes of the same settings and the same pattern memory."""
    from rtl_model.cycle import Settings, planes

    size = board.info().geometry
    taken = capture.burst(board, frames, clear=True)
    given = taken.settings
    settings = Settings(
        threshold=given["sensor_threshold"],
        clock_select=given["sensor_clock_select"],
        reset_rule=given["sensor_reset_rule"],
        rows=(given["sensor_rows"] & 0xFFFF, given["sensor_rows"] >> 16),
        columns=(given["sensor_columns"] & 0xFFFF, given["sensor_columns"] >> 16),
        pattern=given["sensor_pattern"],
        level=given["sensor_level"],
        first_frame=int(taken.frames[0]),
    )
    image = pattern_of(board) if settings.pattern == 0 else None
    must = planes(size, settings, image, frames)
    return taken, Burst("capture", taken.planes, must, compare(taken.planes, must, size.lanes))


def uploaded_image(size: Geometry, seed: int) -> npt.NDArray[np.uint8]:
    """The image that a run shows the board: (rows, columns) uint8 electrons of a tick, a bright
    disc and a ramp under shot-like noise of `seed`."""
    row, column = np.mgrid[: size.rows, : size.columns]
    y, x = (row + 0.5) / size.rows - 0.5, (column + 0.5) / size.columns - 0.5
    light = 20 + 100 * (x + 0.5) + 110 * (x * x + y * y < 0.09)
    noise = np.random.Generator(np.random.Philox(seed)).integers(-12, 13, light.shape)
    return np.clip(np.rint(light) + noise, 0, 255).astype(np.uint8)
