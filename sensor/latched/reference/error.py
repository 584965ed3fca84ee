"""The error of the reference tier itself."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from sensor.latched.reference.law import law_error, law_of
from sensor.latched.setting import CameraSetting

DRAWS = 256
"""Number of thresholds that are compared with their distribution."""


def reference_error(setting: CameraSetting, numbers: npt.NDArray[np.uint32]) -> float:
    """Relative error of the reference tier.

    It is the error of the first thresholds of these pixels against the inverse of their
    distribution. Instants are in closed form and exact up to rounding.

    Args:
        setting: setting of the camera.
        numbers: (n,) uint32, numbers of the pixels.
    """
    model = setting.model
    words = philox4x32((numbers, 0, 0, 0), (setting.seed, Stream.SHOT_NOISE))[0]
    return law_error(law_of(model.threshold, model.threshold_noise, model.shot), words)
