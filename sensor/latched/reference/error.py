"""The error of the reference tier itself."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from sensor.latched.reference.law import law_error, law_of
from sensor.latched.setting import CameraSetting

__all__ = ["DRAWS", "reference_error"]

DRAWS = 256
"""Thresholds on which the reference is compared with its law."""


def reference_error(setting: CameraSetting, numbers: npt.NDArray[np.uint32]) -> float:
    """Relative error of the reference tier: the thresholds of the first spikes of these pixels
    against the inverse of their law. Its time is in closed form, exact to roundings.

    Args:
        setting: of the camera.
        numbers: (n,) numbers of pixels, row by row.
    """
    model = setting.model
    words = philox4x32((numbers, 0, 0, 0), (setting.seed, Stream.SHOT_NOISE))[0]
    return law_error(law_of(model.threshold, model.threshold_noise, model.shot), words)
