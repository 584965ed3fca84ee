"""Captured frames of a board: their clock, and their comparison with the cycle model.

A board's reading of its charges is compared with the camera model's of the same charges as well.

The models are imported in the functions that need them: the cycle model imports numba, and the
sensor's needs what Windows lacks, where boards are brought up too.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from cosim import Clock
from rtl_model.bringup.bench.bench import Burst
from rtl_model.bringup.bench.wrong_bits import compare
from rtl_model.geometry import Geometry
from rtl_model.host import Board, Captured, Reading, capture, read_charges

_FRAMES = 1024  # planes of the model at a time


def frame_clock(board: Board) -> Clock:
    """The frame clock from the board's registers: nominal clock divided by clocks of a tick."""
    info = board.info()
    tick = max(board.read_twice("sensor_tick_clocks"), board.read_twice("sensor_tick_minimum"))
    exact = Fraction(info.clock_hz, tick << board.read_twice("sensor_clock_select"))
    return Clock(exact.numerator, exact.denominator)


def read_pattern(board: Board) -> npt.NDArray[np.uint8]:
    """Reads the pattern memory, (rows, columns) uint8, until two readings agree."""
    size = board.info().geometry
    words = board.bone.read_twice(board.csr.base("pattern_mem"), size.pattern_bytes // 4)
    padded = np.array(words, "<u4").view(np.uint8).reshape(size.rows, -1)
    return padded[:, : size.columns]


def compare_burst(
    name: str,
    captured: Captured,
    size: Geometry,
    registers: Mapping[str, int],
    image: npt.NDArray[np.uint8] | None,
    first_frame: int = 0,
) -> Burst:
    """Compares captured planes with the cycle model's.

    Args:
        name: name of the test pattern.
        captured: frames from `first_frame` on, the sensor having started without charge.
        size: geometry of the board.
        registers: values of the `sensor_*` registers during the burst.
        image: contents of the pattern memory, (rows, columns); None if no pixel reads it.
        first_frame: number of the first frame.
    """
    from rtl_model.cycle import Settings, planes

    settings = Settings.from_registers(registers, first_frame)
    expected = planes(size, settings, image, len(captured.planes))
    wrong = compare(captured.planes, expected, size.lanes)
    return Burst(name, captured.planes, expected, wrong)


def capture_and_compare(board: Board, frames: int) -> tuple[Captured, Burst]:
    """Captures frames under the present registers and compares them with the cycle model's.

    The burst starts with frame 0 and without charge. Raises LineFault.
    """
    captured = capture.burst(board, frames, clear=True)
    image = read_pattern(board) if captured.settings["sensor_pattern"] == 0 else None
    return captured, compare_burst(
        "capture", captured, board.info().geometry, captured.settings, image,
        int(captured.frames[0]),
    )  # fmt: skip


def read_and_compare(board: Board, levels: int) -> tuple[Reading, npt.NDArray[np.uint16]]:
    """Reads the charges, and computes the levels that they should have.

    The sensor must have had its present settings since the clear.

    Returns:
        The reading, and the expected levels, (rows, columns) uint16.

    Raises:
        InputError, LineFault: as `read_charges`.
    """
    from rtl_model.cycle import Settings, planes  # imports numba
    from rtl_model.registers import quantum

    reading = read_charges(board, levels)
    size, registers = board.info().geometry, reading.captured.settings
    image = read_pattern(board) if registers["sensor_pattern"] == 0 else None
    charge = np.zeros((size.rows, size.columns), np.int64)
    for first in range(0, reading.frames, _FRAMES):
        settings = Settings.from_registers(registers, first)
        planes(size, settings, image, min(_FRAMES, reading.frames - first), charge)
    # A charge that a saturated pixel holds above the threshold has no level of its own.
    from sensor.reconstruct.readings import quantised

    expected = quantised(charge, quantum(registers["sensor_threshold"]), levels)
    return reading, np.minimum(expected, np.uint16(levels - 1))
