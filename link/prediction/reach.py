"""Predicted rate and error rate at any distance, from geometry and closed forms.

A cell is observed by its camera pixels in its ticks. The charge of an observation is normal about
its mean: the cell's share of the light, the neighbours' (each on half of the time), and the
background. With P(spike | on) = p and P(spike | off) = q of an observation, independent
observations whose log likelihood ratios are added have an error probability of at most 1/2
prod(sqrt(p q) + sqrt((1 - p) (1 - q))), the Bhattacharyya bound (Kailath, IEEE Trans. Commun.
Technol. 15:52, 1967). Observations are not fully independent, and turbulence, fixed pattern and
drift are not included. The result is therefore an estimate, which a run may exceed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.mode import CELLS, LINE_CODES, Mode, codes_of, ticks_chosen
from link.receiving.tags import least_module
from link.theory import Reset, word_loss

__all__ = [
    "LEAST_CELL", "CellScene", "Reach", "edge_share", "longest_run", "predict_errors", "reach",
]  # fmt: skip

_PLACES = 5
"""Positions of a camera pixel within the cell's grid, along each axis, that are averaged."""
_WORTH = 1e-3
"""Share of its cell's light below which an observation is not counted."""
_ALIVE = 1e-12
"""Probability of no spike so far below which all pixels are taken to have fired."""
_LOST = 0.03
"""Share of frames that may be lost: what the default overhead recovers."""
LEAST_CELL = 1.2
"""Smallest side of a cell that a run chooses itself, camera pixels: closer to 1, the beat of both
grids leaves cells without a pixel of their own."""
_UNCODED_RUN = 8
"""Assumed longest run of equal symbols if the code does not limit runs."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CellScene:
    """Light of a link's cells, and the camera's pixel.

    Attributes:
        pixel: camera pixels for a panel pixel.
        blur: standard deviation of the image's blur, camera pixels.
        on, background: electrons of a tick over the threshold.
        threshold: electrons.
        noise: standard deviation of the threshold, electrons.
        reset: reset rule of the camera.
        phase: delay of symbols after the latch, ticks.
    """

    pixel: float
    blur: float
    on: float
    background: float
    threshold: float
    noise: float
    reset: Reset
    phase: float


def longest_run(mode: Mode) -> int:
    """Returns the assumed longest run of equal symbols."""
    return mode.code.run_limit or _UNCODED_RUN


def edge_share(x: Values, blur: float) -> Values:
    """Returns the share of a camera pixel at x beyond a blurred edge at 0.

    It is the integral of the normal distribution over the pixel.
    """
    from scipy.special import ndtr

    if blur <= 0:
        return np.clip(x + 0.5, 0.0, 1.0)

    def primitive(y: Values) -> Values:
        z = y / blur
        out: Values = y * ndtr(z) + blur / math.sqrt(2 * math.pi) * np.exp(-z * z / 2)
        return out

    return primitive(x + 0.5) - primitive(x - 0.5)


def _shares(side: float, blur: float) -> Values:
    """Returns the share of each pixel's light along a line that its cell brings, (places, pixels).

    Args:
        side: length of a cell, camera pixels.
        blur: standard deviation, camera pixels.
    """
    reach = math.ceil(side / 2 + 3 * blur + 1)
    pixels = np.arange(-reach, reach + 1)
    place = (np.arange(_PLACES) + 0.5) / _PLACES - 0.5
    at = pixels + place[:, None]
    return edge_share(at + side / 2, blur) - edge_share(at - side / 2, blur)


def _fires(scene: CellScene, mean: Values, spread: Values, run: int) -> Values:
    """Returns P(spike in a tick).

    Args:
        scene: the pixel.
        mean: electrons of a tick over the threshold.
        spread: standard deviation of the neighbours' part of it.
        run: ticks over which charge may have accumulated.
    """
    from scipy.special import ndtr

    if scene.reset != "hard":  # with carried charge, the mean rate is the probability
        return np.clip(mean, 0.0, 1.0)
    q, total, alive, out = scene.threshold, 0.0, np.ones_like(mean), np.zeros_like(mean)
    before = np.zeros_like(mean)
    for tick in range(1, run + 1):  # ticks of a dark run, all equally likely
        width = np.sqrt(tick * np.maximum(mean, 1e-12) / q + (scene.noise / q) ** 2
                        + tick * spread**2)  # fmt: skip
        full = np.maximum(ndtr((tick * mean - 1) / width), before)
        # If all have fired, the light fills the threshold in every tick: they fire again.
        out += np.where(alive > _ALIVE, (full - before) / np.maximum(alive, _ALIVE), 1.0)
        alive, before, total = np.maximum(1 - full, 1e-300), full, total + 1
    return np.clip(out / total, 0.0, 1.0)


def predict_errors(scene: CellScene, mode: Mode) -> float:
    """Returns an estimate of the raw bit error rate of the joint decision.

    It is the Bhattacharyya bound of a model with independent observations and normal light of the
    neighbours.
    """
    if scene.blur > mode.cell * scene.pixel:  # the neighbours contribute more than the cell
        return 0.5
    shares = _shares(mode.cell * scene.pixel, scene.blur)
    ticks = np.concatenate([[1 - scene.phase], np.ones(mode.ticks - 1), [scene.phase]])
    mine = shares[:, None, :, None, None] * shares[None, :, None, :, None] * ticks
    # The remaining light comes mostly from four neighbours.
    rest = 1 - mine
    spread = scene.on * rest / 2 / 2
    run = min(longest_run(mode) * mode.ticks, 64)
    base = scene.background + scene.on * rest / 2
    on = _fires(scene, base + scene.on * mine, spread, 1)
    off = _fires(scene, base, spread, run)
    factor = np.sqrt(on * off) + np.sqrt((1 - on) * (1 - off))
    factor = np.where(mine > _WORTH, np.minimum(factor, 1.0), 1.0)
    product = np.exp(np.log(np.maximum(factor, 1e-30)).sum(axis=(2, 3, 4)))
    return float(0.5 * product.mean())


@dataclass(frozen=True)
class Reach:
    """Predicted rate at a distance.

    Attributes:
        distance: m.
        rate: of the best mode that works, bit/s; 0 if none does.
        mode: that mode.
        errors: its predicted raw bit error rate.
        tags: whether the tags are large enough in the image to be detected; otherwise no rate is
            predicted.
    """

    distance: float
    rate: float
    mode: Mode | None
    errors: float
    tags: bool = True


def reach(
    scene: CellScene, mode: Mode, at: float, focal_length: float, distances: Values, hz: float,
    sensor: tuple[int, int], air: Values,
) -> list[Reach]:  # fmt: skip
    """Returns the best rate at other distances, with this panel, lens and camera.

    Only modes that a run would choose itself are considered, at the run's phase. The irradiance of
    a resolved panel does not fall with distance; the images of its pixels shrink.

    Args:
        scene, mode: of the run; the panel stays.
        at: distance of the run, m.
        focal_length: m.
        distances: m.
        hz: planes per second.
        sensor: (height, width) of the camera.
        air: transmission at each distance, relative to the run's.
    """
    modes = [
        Mode(mode.width, mode.height, cell, ticks, line, parity, rate)
        for cell in CELLS for line in LINE_CODES[1:] for ticks in ticks_chosen(line)
        for parity, rate in codes_of(line)
    ]  # fmt: skip
    worth = sorted(modes, key=lambda m: -_coded(m, hz))
    out = []
    for distance, through in zip(distances, air, strict=True):
        pixel = scene.pixel * (at - focal_length) / (distance - focal_length)
        best = Reach(float(distance), 0.0, None, 0.5)
        there = replace(scene, pixel=pixel, on=scene.on * through)
        errors: dict[tuple[int, int, str], float] = {}
        if pixel * Layout(mode).module < least_module(scene.blur):
            out.append(replace(best, tags=False))
            continue
        if pixel * mode.height <= sensor[0] and pixel * mode.width <= sensor[1]:
            for each in worth:
                key = (each.cell, each.ticks, each.line)
                if each.cell * pixel < LEAST_CELL:
                    continue
                if key not in errors:
                    errors[key] = predict_errors(there, each)
                if word_loss(each, errors[key]) < _LOST:
                    best = Reach(float(distance), _coded(each, hz), each, errors[key])
                    break
        out.append(best)
    return out


def _coded(mode: Mode, hz: float) -> float:
    layout = Layout(mode)
    line = mode.code.bits / layout.group
    return layout.cells * hz / mode.ticks * line * mode.word_rate
