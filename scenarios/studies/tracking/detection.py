"""Detection of bright objects before a known background.

The difference to the mean of earlier pictures is smoothed and compared with its own noise, and the
connected components above the threshold are the objects. Background subtraction is textbook
(Szeliski, Computer Vision, section 8.4); the components are those of OpenCV.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

SMOOTH: Final = 1.5
"""Standard deviation of the filter, pixels, near that of the object (a matched filter)."""
THRESHOLD: Final = 6.0
"""Threshold over the noise of the difference. Of Gaussian noise, 1e-9 of the pixels are above."""
LEAST: Final = 4
"""Fewest pixels of an object. A smooth peak of noise is smaller, an object of this study larger."""
AROUND: Final = 5.0
"""Standard deviation of the surroundings of a pixel in which its variance is estimated, pixels."""
Plane = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Detection:
    """An object in a picture.

    Attributes:
        x, y: its centroid, columns and rows, weighted by the difference.
        weight: sum of the difference over its pixels.
    """

    x: float
    y: float
    weight: float


def _smooth(plane: Plane, width: float = SMOOTH) -> Plane:
    import cv2

    # There is no difference beyond the border; a reflected one would double the noise there.
    border = cv2.BORDER_CONSTANT
    return np.asarray(cv2.GaussianBlur(plane, (0, 0), width, borderType=border), np.float32)


@dataclass(frozen=True, eq=False)
class Background:
    """The picture without objects.

    Attributes:
        mean: (H, W) float32.
        noise: standard deviation of the smoothed difference of a later picture to it, (H, W)
            float32.
    """

    mean: Plane
    noise: Plane

    @classmethod
    def learn(cls, pictures: Sequence[Plane]) -> Background:
        """From two or more pictures without objects. With n pictures, the squares of the residuals
        are (n - 1) / n of the variance, and a later difference has (n + 1) / n of it. Few pictures
        give a poor variance of a pixel, so that of its surroundings is taken."""
        n = len(pictures)
        if n < 2:
            raise ValueError(f"a background must have 2 pictures or more, not {n}")
        mean = np.asarray(np.mean(pictures, axis=0, dtype=np.float64), np.float32)
        square = np.zeros_like(mean)
        for picture in pictures:
            square += _smooth(picture - mean) ** 2 / np.float32(n - 1)
        around = _smooth(square, AROUND) / _smooth(np.ones_like(mean), AROUND)
        return cls(mean, np.sqrt(around * np.float32((n + 1) / n)))


def detect(picture: Plane, background: Background) -> list[Detection]:
    """The objects in a picture, the heaviest first."""
    import cv2

    rise = _smooth(picture - background.mean)
    # Without noise, rounding of float32 is left.
    least = np.maximum(THRESHOLD * background.noise, np.float32(1e-5))
    above = (rise > least).astype(np.uint8)
    count, labels = cv2.connectedComponents(above, connectivity=8)
    if count == 1:
        return []
    rows, columns = np.nonzero(above)
    label, weight = labels[rows, columns], rise[rows, columns].astype(np.float64)
    total, x, y = (
        np.bincount(label, weight * factor, count)[1:] for factor in (1.0, columns, rows)
    )
    large = np.bincount(label, minlength=count)[1:] >= LEAST
    found = zip((x / total)[large], (y / total)[large], total[large], strict=True)
    return sorted((Detection(*map(float, each)) for each in found), key=lambda d: -d.weight)
