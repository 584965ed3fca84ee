"""What rate and how many errors geometry and closed forms predict, at any distance.

A cell's looks are its camera pixels in its ticks. A look's charge is normal about its mean: its
own cell's share of the light, the neighbours' (each on half of the time), and what shines in any
case. With spikes of P(1 | on) = p and P(1 | off) = q a look, looks that err independently and are
added as log-likelihood ratios are wrong at most with chance 1/2 prod(sqrt(p q) + sqrt((1 - p) (1 -
q))), the Bhattacharyya bound (Kailath, IEEE Trans. Commun. Technol. 15:52, 1967). Looks do not
quite err independently, and turbulence, fixed pattern and drift are not in it: what comes out is an
estimate, which a run may exceed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.mode import CELLS, LINE_CODES, PARITIES, TICKS, Mode
from link.receiving.tags import least_module
from link.theory import Reset, byte_error, rs_word_error

__all__ = [
    "LEAST_CELL", "CellScene", "Reach", "edge_share", "longest_run", "predict_errors", "reach",
]  # fmt: skip

_PLACES = 5
"""Places of a camera pixel within the cell's grid that are averaged over, each way."""
_WORTH = 1e-3
"""Share of its cell's light below which a look is not counted."""
_ALIVE = 1e-12
"""Chance of no spike so far below which pixels have fired."""
_LOST = 0.03
"""Frames that a transmission may lose: what the default overhead makes good."""
LEAST_CELL = 1.2
"""Camera pixels to a cell's side, at least, that a run takes on its own: nearer to 1 the grids'
beat leaves cells without a pixel of their own."""
_UNCODED_RUN = 8
"""Run of equal symbols that is reckoned with where the code does not limit runs."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CellScene:
    """pixel: camera pixels to a panel pixel. blur: standard deviation of the image's blur, camera
    pixels. on, background: electrons a tick over the threshold. threshold: electrons. noise: of it,
    electrons. reset: the camera's rule. phase: ticks by which symbols are late against the latch.
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
    """Symbols of the longest run of equal ones that is reckoned with."""
    return mode.code.run_limit or _UNCODED_RUN


def edge_share(x: Values, blur: float) -> Values:
    """Share of a camera pixel centred at x that lies beyond an edge at 0, blurred: the integral of
    the normal distribution over the pixel."""
    from scipy.special import ndtr

    if blur <= 0:
        return np.clip(x + 0.5, 0.0, 1.0)

    def primitive(y: Values) -> Values:
        z = y / blur
        out: Values = y * ndtr(z) + blur / math.sqrt(2 * math.pi) * np.exp(-z * z / 2)
        return out

    return primitive(x + 0.5) - primitive(x - 0.5)


def _shares(side: float, blur: float) -> Values:
    """(places, pixels) share of each pixel's light along a line that its own cell brings, for cells
    `side` pixels long."""
    reach = math.ceil(side / 2 + 3 * blur + 1)
    pixels = np.arange(-reach, reach + 1)
    place = (np.arange(_PLACES) + 0.5) / _PLACES - 0.5
    at = pixels + place[:, None]
    return edge_share(at + side / 2, blur) - edge_share(at - side / 2, blur)


def _fires(scene: CellScene, mean: Values, spread: Values, run: int) -> Values:
    """P(spike in a tick). mean: electrons of a tick over the threshold; spread: of the neighbours'
    part of it. run: ticks for which charge may have gathered."""
    from scipy.special import ndtr

    if scene.reset != "hard":  # what is left over makes the rate itself the chance
        return np.clip(mean, 0.0, 1.0)
    q, total, alive, out = scene.threshold, 0.0, np.ones_like(mean), np.zeros_like(mean)
    before = np.zeros_like(mean)
    for tick in range(1, run + 1):  # a tick of a dark stretch, each as likely as the others
        width = np.sqrt(tick * np.maximum(mean, 1e-12) / q + (scene.noise / q) ** 2
                        + tick * spread**2)  # fmt: skip
        full = np.maximum(ndtr((tick * mean - 1) / width), before)
        # Where all have fired already, light alone fills the threshold: they fire again.
        out += np.where(alive > _ALIVE, (full - before) / np.maximum(alive, _ALIVE), 1.0)
        alive, before, total = np.maximum(1 - full, 1e-300), full, total + 1
    return np.clip(out / total, 0.0, 1.0)


def predict_errors(scene: CellScene, mode: Mode) -> float:
    """An estimate of the raw bit error rate of the joint decision: Bhattacharyya's bound on that of
    a model whose looks are independent of each other, the neighbours' light normal."""
    if scene.blur > mode.cell * scene.pixel:  # a look sees its neighbours more than its own cell
        return 0.5
    shares = _shares(mode.cell * scene.pixel, scene.blur)
    ticks = np.concatenate([[1 - scene.phase], np.ones(mode.ticks - 1), [scene.phase]])
    mine = shares[:, None, :, None, None] * shares[None, :, None, :, None] * ticks
    # Of the rest of a look's light, each neighbour brings a share; four of them bring most.
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
    """distance: m. rate: bits a second of the best mode that works, 0 where none does. mode: that
    mode. errors: predicted raw bit error rate of it. tags: whether the tags are large enough in the
    image to be found, without which no rate is foreseen."""

    distance: float
    rate: float
    mode: Mode | None
    errors: float
    tags: bool = True


def _frame_loss(errors: float, mode: Mode) -> float:
    """Chance that a codeword is wrong beyond mending: bytes of independent bits."""
    bits = round(8 * Layout(mode).group / mode.code.bits)
    return float(rs_word_error(255, 255 - mode.parity, byte_error(min(errors, 0.5), bits)))


def reach(
    scene: CellScene, mode: Mode, at: float, focal_length: float, distances: Values, hz: float,
    sensor: tuple[int, int], air: Values,
) -> list[Reach]:  # fmt: skip
    """The best rate at other distances, with this panel, lens and camera. scene, mode: those of the
    run, whose cell, ticks, line and parity may change. at: its distance, m. sensor: camera pixels,
    (height, width). air: of each distance, transmission relative to the run's. hz: planes a
    second.

    Only modes that a run would try on its own. The irradiance of a resolved panel does not fall
    with distance; its pixels' images shrink.
    """
    modes = [
        replace(mode, cell=cell, ticks=ticks, line=line, parity=parity)
        for cell in CELLS for ticks in TICKS[1:4] for line in LINE_CODES[1:] for parity in PARITIES
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
                if _frame_loss(errors[key], each) < _LOST:
                    best = Reach(float(distance), _coded(each, hz), each, errors[key])
                    break
        out.append(best)
    return out


def _coded(mode: Mode, hz: float) -> float:
    layout = Layout(mode)
    line = mode.code.bits / layout.group
    return layout.cells * hz / mode.ticks * line * (255 - mode.parity) / 255
