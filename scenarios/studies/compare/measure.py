"""The figures of one camera in a comparison, and how blur and noise among them are measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.fft import dctn
from scipy.optimize import minimize_scalar

Image = npt.NDArray[np.float64]
FIGURES = (
    "dynamic_range", "dynamic_range_controls", "blur", "noise", "data_rate", "data_rate_pixel",
    "latency", "psnr", "psnr_smear_corrected", "skew", "exposure", "saturated", "off",
)  # fmt: skip
"""Names of all figures of a row, in the order of the table."""
EDGE: Final = 2.5631
"""10 to 90 % width of an edge after a Gaussian blur, in standard deviations: 2 x 1.28155."""
_WIDEST: Final = 40.0
"""Upper end of the search for the standard deviation of the blur, pixels."""
_LEAST: Final = 200
"""Minimum number of pixels for a measurement of noise."""
_GREY: Final = (0.3, 0.7)
"""Range of reflectance that counts as mid-grey."""
_LEVELS: Final = (*(10 ** (n / 8 - 2) for n in range(16)), 1.01)
"""Limits of the levels of reflectance of a curve: eight a decade from 0.01 on."""


@dataclass(frozen=True)
class Figure:
    """A measured figure.

    Attributes:
        value: the value, None if it cannot be measured.
        unit: unit, "1" for a dimensionless figure.
    """

    value: float | None
    unit: str


@dataclass(frozen=True)
class Snr:
    """Signal over temporal noise where nothing moves.

    Attributes:
        reflectance: mean of the pixels.
        measured: ratio in a camera's images.
        formula: ratio by the closed form of the camera's pixels; None where there is none.
    """

    reflectance: float
    measured: float
    formula: float | None = None


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera of a comparison.

    Attributes:
        name: short name.
        title: name for headings.
        setting: description of the setting.
        note: remark for the table.
        image: estimate of reflectance at the instant, (H, W) in [0, 1].
        figures: figures by the names of `FIGURES`.
        seconds: run time of simulation and measurement, s.
        snr: signal over noise by reflectance, from dark to bright.
        corrected: image after correction of the frame-transfer smear; None without smear.
    """

    name: str
    title: str
    setting: str
    note: str
    image: npt.NDArray[np.float64]
    figures: dict[str, Figure]
    seconds: float = field(default=0.0)
    corrected: npt.NDArray[np.float64] | None = None
    snr: list[Snr] = field(default_factory=list)

    def row(self) -> dict[str, Any]:
        """The row of the document."""
        figures = {n: {"value": f.value, "unit": f.unit} for n, f in self.figures.items()}
        return {
            "imager": self.name, "title": self.title, "setting": self.setting, **figures,
            "note": self.note,
        }  # fmt: skip


def still_blur(image: Image, truth: Image) -> float | None:
    """10 to 90 % width of a static edge, pixels.

    The width is that of the Gaussian blur of the truth that fits the image best, by least squares
    with a gain and an offset. Temporal noise adds the same residual to every trial.

    Both planes are sampled by pixels, so the blur is applied in the spectrum, exp(-(k sigma)^2/2),
    with reflection at the borders. A Gaussian kernel sampled at pixels is narrower than its sigma
    below 0.7 pixels; with it, widths of 1 pixel were 22 % too large.

    Args:
        image: estimate of reflectance, (H, W).
        truth: true reflectance, (H, W).

    Returns:
        The width; None if the best Gaussian explains less than a tenth of the variance.
    """
    blurred, sharp = (dctn(plane, norm="ortho") for plane in (image, truth))
    blurred[0, 0] = sharp[0, 0] = 0.0  # the means
    power = float((blurred * blurred).sum())
    if power <= 0:
        return None
    down, across = (np.pi * np.arange(n) / n for n in truth.shape)
    squared = down[:, None] ** 2 + across**2

    def residual(sigma: float) -> float:
        """Unexplained share of the variance."""
        trial = sharp * np.exp(-(sigma**2) / 2 * squared)
        square, product = float((trial * trial).sum()), float((trial * blurred).sum())
        return 1 - (product * product / square / power if square > 0 and product > 0 else 0.0)

    grid = np.concatenate([[0.0], np.geomspace(0.25, _WIDEST, 14)])
    values = [residual(float(s)) for s in grid]
    at = int(np.argmin(values))
    if values[at] > 0.9:
        return None
    low, high = grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)]
    fit = minimize_scalar(residual, bounds=(low, high), method="bounded", options={"xatol": 1e-3})
    best = float(fit.x) if float(fit.fun) < values[at] - 1e-9 else float(grid[at])
    return EDGE * best


def noise(images: Sequence[Image], truth: Image, where: npt.NDArray[np.bool_]) -> float | None:
    """Relative temporal noise at mid-grey: the RMS over pixels of the standard deviation between
    images, divided by the median signal.

    Args:
        images: estimates of reflectance, each (H, W).
        truth: true reflectance, (H, W).
        where: pixels without motion, (H, W).

    Returns:
        The noise; None for fewer than three images or _LEAST pixels.
    """
    return _relative(images, where & (truth > _GREY[0]) & (truth < _GREY[1]))


def snr_curve(images: Sequence[Image], truth: Image, where: npt.NDArray[np.bool_]) -> list[Snr]:
    """Signal over temporal noise against reflectance, from dark to bright: the inverse of `noise`
    in each range of `_LEVELS` that has enough pixels and noise. The arguments are those of
    `noise`."""
    made = []
    for low, high in pairwise(_LEVELS):
        level = where & (truth >= low) & (truth < high)
        relative = _relative(images, level)
        if relative:
            made.append(Snr(float(truth[level].mean()), 1 / relative))
    return made


def _relative(images: Sequence[Image], where: npt.NDArray[np.bool_]) -> float | None:
    """Noise over signal of these pixels; None for too few, or without a signal."""
    if len(images) < 3 or where.sum() < _LEAST:
        return None
    stack = np.stack([image[where] for image in images])
    signal = float(np.median(stack.mean(axis=0)))
    spread = math.sqrt(float(np.mean(stack.var(axis=0, ddof=1))))
    return spread / signal if signal > 0 else None
