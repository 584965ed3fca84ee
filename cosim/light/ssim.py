"""Structural similarity, SSIM (Wang et al., IEEE Trans. Image Process. 13:600, 2004)."""

from __future__ import annotations

import threading
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.light.light import Plane

C1, C2 = np.float32(0.01**2), np.float32(0.03**2)
"""Constants of Wang et al. for peak 1."""
HALF = np.float32(0.5)
"""Subtracted from both images before squaring, so that float32 is precise enough."""
EDGE = 5
"""Width of the border in which the 11 x 11 window is incomplete, pixels."""
Levels = npt.NDArray[np.floating[Any]]


_LOCAL = threading.local()
"""Memory of a thread for one comparison: fresh memory would take as long as the arithmetic."""


def _memory(shape: tuple[int, ...]) -> Plane:
    if getattr(_LOCAL, "memory", np.empty(0)).shape != shape:
        _LOCAL.memory = np.empty(shape, np.float32)
    memory: Plane = _LOCAL.memory
    return memory


def _blur(x: Plane, into: Plane) -> None:
    """Gaussian-weighted mean in the window of each pixel."""
    size = 2 * EDGE + 1
    cv2.GaussianBlur(x, (size, size), 1.5, dst=into, borderType=cv2.BORDER_REFLECT)


@njit(cache=True, nogil=True)
def _products(image, truth, x, square, product):  # type: ignore[no-untyped-def]
    """x = image - 1/2, its square, and its product with `truth`; all flat."""
    for n in range(x.size):
        v = image[n] - HALF
        x[n] = v
        square[n] = v * v
        product[n] = v * truth[n]


@njit(cache=True, nogil=True, error_model="numpy")  # an exception would prevent vectorisation
def _similarity(moments, truth_mean, truth_power, out):  # type: ignore[no-untyped-def]
    """SSIM from the blurred x, square and product, and the moments of the truth; all flat."""
    means, squares, products = moments
    two = np.float32(2.0)
    for n in range(out.size):
        power = squares[n] - means[n] * means[n]
        common = products[n] - means[n] * truth_mean[n]
        mean, level = means[n] + HALF, truth_mean[n] + HALF
        top = (two * mean * level + C1) * (two * common + C2)
        out[n] = top / ((power + truth_power[n] + C2) * (mean * mean + level * level + C1))


def inside(values: Plane) -> Plane:
    """The values for which the window is complete."""
    return values[EDGE:-EDGE, EDGE:-EDGE]


def inside_mean(values: Plane) -> float:
    """Mean of the values for which the window is complete; NaN without any."""
    return float(_mean(inside(values)))


@njit(cache=True, nogil=True)
def _mean(values):  # type: ignore[no-untyped-def]
    """The mean of (H, W) values in float64; numpy's takes four times as long for a part of an
    array."""
    total = 0.0
    for row in values:
        for value in row:
            total += value
    return total / values.size if values.size else np.nan


class Likeness:
    """A true image for comparisons; terms that depend on it alone are computed once."""

    def __init__(self, truth: Levels) -> None:
        self._truth = truth.astype(np.float32) - HALF
        self._mean, self._power = np.empty_like(self._truth), np.empty_like(self._truth)
        _blur(self._truth, self._mean)
        _blur(self._truth * self._truth, self._power)
        self._power -= self._mean * self._mean

    def map(self, image: Levels) -> Plane:
        """SSIM of an image with the true image, (H, W) float32, peak 1. The Gaussian window is 11 x
        11 with sigma 1.5, mirrored at the edges, as in scikit-image."""
        light = np.ascontiguousarray(image, np.float32)
        parts = _memory((6, *light.shape))
        flat = parts.reshape(6, -1)
        _products(light.ravel(), self._truth.ravel(), *flat[:3])
        for part, blurred in zip(parts[:3], parts[3:], strict=True):
            _blur(part, blurred)
        out = np.empty_like(light)
        _similarity(
            (flat[3], flat[4], flat[5]), self._mean.ravel(), self._power.ravel(), out.ravel()
        )
        return out
