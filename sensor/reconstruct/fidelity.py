"""Fidelity: distance of an image from the truth of the scene.

It says how good the camera is, not how good the simulation is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim import Plane
from cosim.compute.stopping import threads
from cosim.light.ssim import Likeness, inside_mean
from cosim.run.result import Metric

LEAST_RATE = 1e-30
"""Least spike rate of white, per cycle: smaller numbers leave float32."""
Estimate = npt.NDArray[np.float64]
_NO_FIDELITY: Final = "no image has its whole window in the run, or images are below 11 x 11 pixels"


class Imaged(Protocol):
    """One instant: its cycle, its true reflectance, and an estimate under each method's name."""

    @property
    def cycle(self) -> int: ...
    @property
    def truth(self) -> Plane: ...


def to_white(
    rate: npt.NDArray[np.floating[Any]], white_rate: float | npt.NDArray[np.float64]
) -> Estimate:
    """Linear estimate of reflectance: spikes a cycle, scaled so that white = 1, in [0, 1].

    In float64, so that a picture of it is the one `viform image --scale WHITE_RATE` makes: 1/2 a
    cycle at 0.6 is 212.5 of 255, and float32 would fall to the other side of it.
    """
    return np.clip(rate.astype(np.float64) / np.maximum(white_rate, LEAST_RATE), 0, 1)


def psnr(image: Estimate, truth: Plane) -> float:
    """Peak signal to noise ratio in dB, peak 1; infinite where they agree."""
    error = float(np.mean((image.astype(np.float64) - truth) ** 2))
    return -10 * math.log10(error) if error > 0 else math.inf


def ssim(image: Estimate, truth: Plane) -> float:
    """Structural similarity with the constants and the 11 x 11 Gaussian window (sigma 1.5) of Wang
    et al., IEEE Trans. Image Process. 13:600, 2004; peak 1. NaN for images under 11 x 11."""
    if min(image.shape) < 11:
        return math.nan
    return inside_mean(Likeness(truth).map(image))


def judge(shots: Sequence[Imaged], methods: Sequence[str]) -> dict[str, Metric]:
    """PSNR and SSIM of each method, mean over the instants; NaN without any."""
    means = {}
    with threads(2) as pool:  # each holds a dozen planes
        for method in methods:
            estimates = [getattr(shot, method) for shot in shots]
            truths = [shot.truth for shot in shots]
            for name, figure, unit in (("psnr", psnr, "dB"), ("ssim", ssim, "1")):
                values = list(pool.map(figure, estimates, truths)) or [math.nan]
                means[f"{method}_{name}"] = Metric(float(np.mean(values)), unit, _NO_FIDELITY)
    return means
