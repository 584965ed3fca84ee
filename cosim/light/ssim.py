"""Structural similarity, SSIM (Wang et al., IEEE Trans. Image Process. 13:600, 2004)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cosim.light.light import Plane

__all__ = ["Likeness", "inside"]

C1, C2 = np.float32(0.01**2), np.float32(0.03**2)
"""Constants of Wang et al. for peak 1."""
HALF = np.float32(0.5)
"""Subtracted from both images before squaring, so that float32 is precise enough."""
EDGE = 5
"""Width of the border in which the 11 x 11 window is incomplete, pixels."""
Levels = npt.NDArray[np.floating[Any]]


def _mean(x: Plane) -> Plane:
    """Gaussian-weighted mean in the window of each pixel."""
    blurred = cv2.GaussianBlur(x, (2 * EDGE + 1, 2 * EDGE + 1), 1.5, borderType=cv2.BORDER_REFLECT)
    return np.asarray(blurred, np.float32)


def inside(values: Plane) -> Plane:
    """The values for which the window is complete."""
    return values[EDGE:-EDGE, EDGE:-EDGE]


class Likeness:
    """A true image for comparisons; terms that depend on it alone are computed once."""

    def __init__(self, truth: Levels) -> None:
        self._truth = truth.astype(np.float32) - HALF
        self._mean = _mean(self._truth)
        self._power = _mean(self._truth * self._truth) - self._mean * self._mean

    def map(self, image: Levels) -> Plane:
        """SSIM of an image with the true image, (H, W) float32, peak 1. The Gaussian window is 11 x
        11 with sigma 1.5, mirrored at the edges, as in scikit-image."""
        x = image.astype(np.float32) - HALF
        mean = _mean(x)
        power = _mean(x * x)
        power -= mean * mean
        common = _mean(x * self._truth)
        common -= mean * self._mean
        mean += HALF
        level = self._mean + HALF
        top = (2 * mean * level + C1) * (2 * common + C2)
        power += self._power
        power += C2
        power *= mean * mean + level * level + C1
        top /= power
        return np.asarray(top, np.float32)
