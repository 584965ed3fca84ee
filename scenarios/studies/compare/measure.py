"""Blur of what stands still, and noise, of an estimate of reflectance, from the images themselves.
Blur of what moves: `motion`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.fft import dctn
from scipy.optimize import minimize_scalar

__all__ = ["EDGE", "noise", "still_blur"]

Image = npt.NDArray[np.float64]
EDGE: Final = 2.5631
"""10 to 90 % width of an edge under a Gaussian blur, in standard deviations: 2 x 1.28155."""
_WIDEST: Final = 40.0
_LEAST: Final = 200
"""Pixels at least that a noise is measured on."""
_GREY: Final = (0.3, 0.7)


def still_blur(image: Image, truth: Image) -> float | None:
    """10 to 90 % width of an edge in pixels: of the Gaussian that makes of the truth what comes
    nearest to the image, by least squares with a gain and an offset.

    Temporal noise adds the same to every trial. None where too little is visible: the best
    Gaussian must explain a tenth of what varies.

    Both are sampled by pixels, so the trial is Gaussian in the spectrum, exp(-(k sigma)^2/2), with
    light reflected at the sides. A Gaussian taken at whole pixels is narrower than its sigma where
    that is below 0.7 pixels, and widths of 1 pixel came out 22 % too large.
    """
    blurred, sharp = (dctn(plane, norm="ortho") for plane in (image, truth))
    blurred[0, 0] = sharp[0, 0] = 0.0  # the means
    power = float((blurred * blurred).sum())
    if power <= 0:
        return None
    down, across = (np.pi * np.arange(n) / n for n in truth.shape)
    squared = down[:, None] ** 2 + across**2

    def left(sigma: float) -> float:
        trial = sharp * np.exp(-(sigma**2) / 2 * squared)
        own, along = float((trial * trial).sum()), float((trial * blurred).sum())
        return 1 - (along * along / own / power if own > 0 and along > 0 else 0.0)

    grid = np.concatenate([[0.0], np.geomspace(0.25, _WIDEST, 14)])
    values = [left(float(s)) for s in grid]
    at = int(np.argmin(values))
    if values[at] > 0.9:
        return None
    low, high = grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)]
    found = minimize_scalar(left, bounds=(low, high), method="bounded", options={"xatol": 1e-3})
    best = float(found.x) if float(found.fun) < values[at] - 1e-9 else float(grid[at])
    return EDGE * best


def noise(images: Sequence[Image], truth: Image, where: npt.NDArray[np.bool_]) -> float | None:
    """Temporal noise over signal at mid-grey: median over pixels of the images' spread, over the
    median signal there. None with fewer than three images or too few such pixels."""
    grey = where & (truth > _GREY[0]) & (truth < _GREY[1])
    if len(images) < 3 or grey.sum() < _LEAST:
        return None
    stack = np.stack([image[grey] for image in images])
    signal = float(np.median(stack.mean(axis=0)))
    spread = math.sqrt(float(np.mean(stack.var(axis=0, ddof=1))))
    return spread / signal if signal > 0 else None
