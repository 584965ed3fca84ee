"""Dense optical flow between two images of a scene (DIS, Kroeger et al., ECCV 2016, of OpenCV)."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

SMOOTH: Final = 0.8
"""Standard deviation of the Gaussian filter before the flow, pixels."""
LEAST: Final = 12
"""Pixels of the shorter side that the flow takes."""
Grey = npt.NDArray[np.uint8]


def flow_grey(rate: npt.NDArray[np.float32], white: float, smooth: float = SMOOTH) -> Grey:
    """A smooth image of 8 bits for the flow, (H, W); `white` becomes 255."""
    import cv2

    blurred = cv2.GaussianBlur(rate, (0, 0), smooth)
    return np.rint(255 * np.clip(blurred / white, 0, 1)).astype(np.uint8)


def optical_flow(first: Grey, second: Grey) -> npt.NDArray[np.float32]:
    """Motion from each pixel of the first image to the second, (H, W, 2) of columns and rows,
    pixels."""
    import cv2

    vision: Any = cv2  # its types lack this
    dis = vision.DISOpticalFlow_create(vision.DISOPTICAL_FLOW_PRESET_MEDIUM)
    dis.setFinestScale(0)  # every pixel; the preset's 1 costs up to 3 dB on fine detail
    return np.asarray(dis.calc(first, second, None), np.float32)
