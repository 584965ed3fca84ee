"""Fidelity: how near an image comes to the scene's truth. Says how good the camera is, not how
good the simulation is."""

from __future__ import annotations

import math

import numpy as np

from cosim import Plane

__all__ = ["psnr", "ssim", "to_white"]


def to_white(rate: Plane, white_rate: float) -> Plane:
    """Linear estimate of reflectance: spikes a cycle, scaled so that white = 1, in [0, 1]."""
    return np.clip(rate / np.float32(white_rate), 0, 1)


def psnr(image: Plane, truth: Plane) -> float:
    """Peak signal to noise ratio in dB, peak 1; infinite where they agree."""
    error = float(np.mean((image.astype(np.float64) - truth) ** 2))
    return -10 * math.log10(error) if error > 0 else math.inf


def ssim(image: Plane, truth: Plane) -> float:
    """Structural similarity with the constants and the 11 x 11 Gaussian window (sigma 1.5) of Wang
    et al., IEEE Trans. Image Process. 13:600, 2004; peak 1. NaN for images under 11 x 11."""
    if min(image.shape) < 11:
        return math.nan
    from skimage.metrics import structural_similarity

    return float(
        structural_similarity(
            image,
            truth,
            data_range=1.0,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
        )
    )
