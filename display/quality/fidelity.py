"""How good what an eye sees on a display is: against what the same eye sees without one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.light.ssim import Likeness, inside
from cosim.run.result import Metric
from display.observe.showing import key_of

__all__ = ["BANDS", "Band", "Judged", "Seen", "judge_glass"]

BANDS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Edges of the luminances, white = 1, at which fidelity is told apart."""
Images = npt.NDArray[np.float32]
Seen = Mapping[str, Mapping[str, Images]]
"""By display and observer: (images, height, width), white = 1. "truth" is the light itself."""


def _decibel(error: float) -> float:
    return -10 * float(np.log10(error)) if error > 0 else float("inf")


@dataclass(frozen=True)
class Band:
    """Fidelity where the truth's luminance is from `low` to `high` of white: mean over instants.
    share: of all pixels. psnr: dB, peak 1. ssim: mean of the map there. bias, spread: mean and RMS
    of the error, relative to the band's mean luminance."""

    low: float
    high: float
    share: float
    psnr: float
    ssim: float
    bias: float
    spread: float


@dataclass(frozen=True)
class Judged:
    """One observer's view of a display. bands: those that the truth has, of the still eye."""

    display: str
    observer: str
    psnr: float
    ssim: float
    bands: tuple[Band, ...]

    def metrics(self) -> dict[str, Metric]:
        """As result.json has them: psnr_60hz, psnr_pursuit_spike, ..."""
        seen = "" if self.observer == "eye" else f"{self.observer}_"
        name = f"{seen}{key_of(self.display)}"
        return {f"psnr_{name}": Metric(self.psnr, "dB"), f"ssim_{name}": Metric(self.ssim, "1")}


class _Truth:
    """One image of the light itself, with what every display's image is held against."""

    def __init__(self, image: npt.NDArray[np.float32]) -> None:
        self.light = np.clip(image, 0, 1)
        self.likeness = Likeness(self.light)
        band = np.searchsorted(BANDS, self.light.ravel(), "right") - 1
        self.band = np.clip(band, 0, len(BANDS) - 2).astype(np.uint8)


@njit(cache=True)
def _by_band(band, values, bands):  # type: ignore[no-untyped-def]
    """(bands, 5) sums over the pixels of each band: pixels, then the four in their order."""
    square, alike, error, light = values
    sums = np.zeros((bands, 5))
    for n in range(band.size):
        row = sums[band[n]]
        row[0] += 1.0
        row[1] += square[n]
        row[2] += alike[n]
        row[3] += error[n]
        row[4] += light[n]
    return sums


def _judge(display: str, observer: str, images: Images, truths: Sequence[_Truth]) -> Judged:
    total, structure = [], []
    sums = np.zeros((len(BANDS) - 1, 5))  # pixels, error^2, ssim, error, truth
    for image, truth in zip(images, truths, strict=True):
        shown = np.clip(image, 0, 1)
        error = shown - truth.light
        square, alike = error * error, truth.likeness.map(shown)
        total.append(_decibel(float(square.mean(dtype=np.float64))))
        whole = inside(alike)
        structure.append(float(whole.mean(dtype=np.float64)) if whole.size else float("nan"))
        if observer == "eye":  # bands are told of the still eye alone
            flat = square.ravel(), alike.ravel(), error.ravel(), truth.light.ravel()
            sums += _by_band(truth.band, flat, len(BANDS) - 1)
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
    return Judged(display, observer, float(np.mean(total)), float(np.mean(structure)), tuple(bands))


def judge_glass(seen: Seen, observers: Sequence[str]) -> list[Judged]:
    """Every display but the truth, through every observer."""
    judged = []
    for observer in observers:
        truths = [_Truth(image) for image in seen["truth"][observer]]
        judged += [
            _judge(display, observer, views[observer], truths)
            for display, views in seen.items() if display != "truth"
        ]  # fmt: skip
    return judged
