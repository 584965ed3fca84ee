"""A board's reading of its charges, compared with the camera model's of the same charges."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rtl_model.bringup.bench.frames import read_pattern
from rtl_model.host import Board, Reading, read_charges
from sensor.reconstruct.readings import quantised

_FRAMES = 1024  # planes of the model at a time


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
    expected = quantised(charge, quantum(registers["sensor_threshold"]), levels)
    return reading, np.minimum(expected, np.uint16(levels - 1))
