"""Fidelity of a display: an observer's image of the display against that of the true light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.cores import cores
from cosim.compute.stopping import threads
from cosim.light.ssim import Likeness, inside_mean
from cosim.run.result import Metric
from display.panels.panel import metric_key

BANDS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Edges of the bands of luminance, white = 1."""
Images = npt.NDArray[np.float32]
ImagesByObserver = Mapping[str, Mapping[str, Images]]
"""Images by display and observer, (images, height, width), white = 1. "truth" is the true light."""


def _decibel(error: float) -> float:
    return -10 * float(np.log10(error)) if error > 0 else float("inf")


@dataclass(frozen=True)
class Band:
    """Fidelity in pixels with a true luminance from `low` to `high`, mean over instants.

    Attributes:
        low, high: edges of the band, white = 1.
        share: share of all pixels.
        psnr: PSNR with peak 1, dB.
        ssim: mean of the SSIM map in the band.
        bias, spread: mean and RMS of the error over the mean luminance of the band.
    """

    low: float
    high: float
    share: float
    psnr: float
    ssim: float
    bias: float
    spread: float


@dataclass(frozen=True)
class Fidelity:
    """Fidelity of a display for one observer.

    Attributes:
        display, observer: names of display and observer.
        psnr, ssim: means over instants; PSNR in dB.
        bands: bands that contain pixels, for the still eye; () for other observers.
    """

    display: str
    observer: str
    psnr: float
    ssim: float
    bands: tuple[Band, ...]

    def metrics(self) -> dict[str, Metric]:
        """The metrics of `result.json`: psnr_60hz, psnr_pursuit_spike, ..."""
        prefix = "" if self.observer == "eye" else f"{self.observer}_"
        name = f"{prefix}{metric_key(self.display)}"
        small = "images are below 11 x 11 pixels"
        return {
            f"psnr_{name}": Metric(self.psnr, "dB", "the image equals the truth"),
            f"ssim_{name}": Metric(self.ssim, "1", small),
        }


class _Truth:
    """An image of the true light, prepared for the comparison with all displays."""

    def __init__(self, image: npt.NDArray[np.float32]) -> None:
        self.light = np.clip(image, 0, 1)
        self.likeness = Likeness(self.light)
        self.band = np.empty(self.light.size, np.uint8)
        _sort(self.light.ravel(), np.array(BANDS[1:-1]), self.band)


@njit(cache=True, nogil=True)
def _sort(light, edges, band):  # type: ignore[no-untyped-def]
    """band = the number of edges up to the light of each pixel; all flat."""
    for n in range(light.size):
        count = 0
        for edge in edges:
            count += light[n] >= edge
        band[n] = count


@njit(cache=True, nogil=True)
def _by_band(band, image, truth, alike, bands):  # type: ignore[no-untyped-def]
    """Sums over the pixels of each band, (bands, 5): the number of pixels, the squared error, the
    similarity, the error, and the true light. All arrays are flat.

    Pixels take turns with two rows of sums, so that no addition waits for the one before it."""
    sums = np.zeros((2, bands, 5))
    for n in range(band.size):
        row, error = sums[n & 1, band[n]], image[n] - truth[n]
        row[0] += 1.0
        row[1] += error * error
        row[2] += alike[n]
        row[3] += error
        row[4] += truth[n]
    return sums[0] + sums[1]


def _compare(display: str, images: Images, *, observer: str, truths: list[_Truth]) -> Fidelity:
    total, structure = [], []
    sums = np.zeros((len(BANDS) - 1, 5))
    for image, truth in zip(images, truths, strict=True):
        clipped = np.clip(image, 0, 1)
        alike = truth.likeness.map(clipped)
        flat = clipped.ravel(), truth.light.ravel(), alike.ravel()
        each = _by_band(truth.band, *flat, len(BANDS) - 1)
        total.append(_decibel(float(each[:, 1].sum() / truth.band.size)))
        structure.append(inside_mean(alike))
        if observer == "eye":  # only the still eye has bands
            sums += each
    count = sums[:, 0].sum()
    bands = []
    for (pixels, square_sum, alike_sum, error_sum, light), low, high in zip(
        sums, BANDS, BANDS[1:], strict=False
    ):
        if not pixels:
            continue
        level = max(light / pixels, 1e-12)
        bands.append(
            Band(
                low, high, pixels / count, _decibel(square_sum / pixels), alike_sum / pixels,
                error_sum / pixels / level, float(np.sqrt(square_sum / pixels)) / level,
            )
        )  # fmt: skip
    return Fidelity(
        display, observer, float(np.mean(total)), float(np.mean(structure)), tuple(bands)
    )


def display_fidelity(images: ImagesByObserver, observers: Sequence[str]) -> list[Fidelity]:
    """Fidelity of every display except the truth, for these observers."""
    fidelity: list[Fidelity] = []
    shown = [display for display in images if display != "truth"]
    with threads(cores()) as pool:
        for observer in observers:
            truths = list(pool.map(_Truth, images["truth"][observer]))
            compare = partial(_compare, observer=observer, truths=truths)
            views = (images[display][observer] for display in shown)
            fidelity += pool.map(compare, shown, views)
    return fidelity
