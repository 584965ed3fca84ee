"""The image that a run of a board uploads into its pattern memory."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rtl_model.geometry import Geometry


def make_image(size: Geometry, seed: int) -> npt.NDArray[np.uint8]:
    """A bright disc on a ramp with uniform noise: (rows, columns) uint8, electrons a tick.

    Args:
        size: geometry of the board.
        seed: seed of the noise.
    """
    row, column = np.mgrid[: size.rows, : size.columns]
    y, x = (row + 0.5) / size.rows - 0.5, (column + 0.5) / size.columns - 0.5
    light = 20 + 100 * (x + 0.5) + 110 * (x * x + y * y < 0.09)
    noise = np.random.Generator(np.random.Philox(seed)).integers(-12, 13, light.shape)
    return np.clip(np.rint(light) + noise, 0, 255).astype(np.uint8)
