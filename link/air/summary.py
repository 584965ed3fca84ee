"""What the bounds of a link's effects read, and the unit of these bounds.

The error of a link's simulation is |BER(with) - BER(without)| over half the width of the 99.9 %
interval of the bit error rate over the run's bits (Clopper and Pearson, Biometrika 26:404, 1934).
Each effect bounds the change of a pixel's charge in a tick; `ber_units` converts it to this unit
with the closed form of the pixel. With reset to zero, the pixel fires if the Poisson electrons of a
tick reach the threshold; with the residual carried over, the same holds from a uniformly
distributed charge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import Summary
from cosim.plan.error import CONFIDENCE
from link.air.air import lens_psf
from link.air.geometry import affine_at, image_of
from link.air.projection import projection_of
from link.air.radiometry import levels
from link.air.scintillation import Flicker
from link.air.setting import Scene
from link.theory.intervals import NORMAL
from sensor import CameraSetting

Values = npt.NDArray[np.float64]
_RISK: Final = 1 - CONFIDENCE
_NODES: Final = 15
"""Nodes of the Gauss-Hermite rule."""
_FACTORS: Final = 49
"""Factors of light between which error rates are interpolated."""
_TICKS: Final = 3
"""Largest number of ticks assumed to decide a bit; fewer ticks give more errors."""


@dataclass(frozen=True)
class LinkSummary(Summary):
    """Summary of a link for the bounds of its effects.

    Attributes:
        on, off: charge in a tick of a pixel well inside an ON or an OFF area, electrons.
        shares: (pixels, cells); for each pixel that decides a cell, the share of its light from the
            cell itself (first) and from its eight neighbours.
        ticks: number of ticks that decide a bit.
        bits: number of bits of the run.
        noise: standard deviation of the threshold, electrons.
        carried: whether the residual charge is carried to the next tick.
    """

    on: float = 0.0
    off: float = 0.0
    shares: tuple[tuple[float, ...], ...] = ((1.0,),)
    ticks: int = 1
    bits: int = 1
    noise: float = 0.0
    carried: bool = False


class _Cell(NamedTuple):
    """What the outcomes of a cell depend on; see `LinkSummary`."""

    threshold: float
    noise: float
    carried: bool
    on: float
    off: float
    shares: tuple[tuple[float, ...], ...]
    ticks: int

    @classmethod
    def of(cls, scene: LinkSummary) -> _Cell:
        return cls(*(getattr(scene, name) for name in cls._fields))


def _fires(scene: _Cell, electrons: Values) -> Values:
    """Probability that a tick's flag is set, for mean charges `electrons`."""
    from scipy.special import gammainc, gammaincc

    z, weight = np.polynomial.hermite_e.hermegauss(_NODES if scene.noise > 0 else 1)
    q = np.maximum(scene.threshold + scene.noise * z, 1.0)
    light = np.maximum(electrons, 1e-300)[..., None]
    fires = gammainc(q, light)
    if scene.carried:  # E[min(1, X / Q)], X Poisson
        below = np.where(q > 1, gammaincc(np.maximum(q - 1, 1e-9), light), 0.0)
        fires = light / q * below + fires
    return np.asarray(np.clip(fires @ (weight / weight.sum()), 0, 1))


def _outcomes(chances: Values, ticks: int) -> Values:
    """Probability of each outcome, ((ticks + 1) ^ pixels,), averaged over patterns.

    An outcome is the number of flags of each pixel in `ticks` ticks.

    Args:
        chances: (patterns, pixels) probability of a flag in a tick, for each pattern of the
            neighbours.
        ticks: number of ticks.
    """
    counts = np.arange(ticks + 1)
    ways = np.array([math.comb(ticks, n) for n in counts])
    p = chances[..., None]
    each = ways * p**counts * (1 - p) ** counts[::-1]  # (patterns, pixels, counts)
    out = each[:, 0]
    for pixel in range(1, each.shape[1]):
        out = (out[:, :, None] * each[:, pixel, None, :]).reshape(len(each), -1)
    return np.asarray(out.mean(axis=0))


@lru_cache(maxsize=512)  # bounds of many effects, and of runs of any length, share most of them
def _both(scene: _Cell, epsilon: float, gain: float) -> tuple[Values, Values]:
    """Probability of each outcome of an ON cell and of an OFF cell; see `ber`."""
    shares = np.array(scene.shares)
    neighbours = shares.shape[1] - 1
    patterns = np.arange(1 << neighbours)[:, None] >> np.arange(neighbours) & 1
    others = patterns @ shares[:, 1:].T  # (patterns, pixels)
    swing = (scene.on - scene.off) * gain
    # Capped where both charges are equal: beyond that point they would tell the bit again.
    wrong = np.minimum(epsilon * scene.on, swing * shares[:, 0] / 2)
    on, off = (
        _outcomes(_fires(scene, scene.off + swing * light + more), scene.ticks)
        for light, more in ((others + shares[:, 0], -wrong), (others, wrong))
    )
    return on, off


def ber(scene: LinkSummary, epsilon: float = 0.0) -> float:
    """Bit error rate of the optimal decision on a cell with random neighbours.

    The decision reads the flags of the pixels and ticks that `scene` names.

    Args:
        scene: the link.
        epsilon: error of all charges, as a share of the charge of an ON pixel; above 0 in the
            direction that makes errors more likely, below 0 less likely.
    """
    return float(min(np.minimum(*_both(_Cell.of(scene), epsilon, 1.0)).sum() / 2, 0.5))


def _rates(scene: LinkSummary, factors: Values) -> Values:
    """Bit error rates (n,) if the panel's light, ON and OFF, is scaled by `factors` (n,).

    The decision does not know the factor: it is the optimal one at factor 1.
    """
    cell = _Cell.of(scene)
    is_on = np.greater(*_both(cell, 0.0, 1.0))
    both = (_both(cell, 0.0, float(factor)) for factor in factors)
    return np.array([np.where(is_on, off, on).sum() / 2 for on, off in both])


def _half_width(rate: float, bits: int) -> float:
    from scipy.special import betaincinv

    errors = round(rate * bits)
    low = betaincinv(errors, bits - errors + 1, _RISK / 2) if errors else 0.0
    high = betaincinv(errors + 1, bits - errors, 1 - _RISK / 2) if errors < bits else 1.0
    return float(high - low) / 2


def ber_units(scene: LinkSummary, epsilon: float, times: float = 0.0) -> float:
    """|BER(with) - BER(without)| in half-widths of the confidence interval.

    Every charge changes by at most `epsilon` of the charge of an ON pixel. The error rate falls
    monotonically with the difference between ON and OFF charges, so the two extremes bound every
    case between them.

    The result is an estimate even if `epsilon` is exact: it uses the error rate and the half-width
    of `ber`, a decision from a few pixels in the middle of the panel, not of a receiver.

    Args:
        scene: the link.
        epsilon: largest change of a charge; its standard deviation if `times` is above 0.
        times: number of independent draws of a random change in the run, at least one; the result
            is then the RMS change of the run's error rate.
    """
    if epsilon <= 0:
        return 0.0
    if not epsilon < 1:
        return float("inf")
    middle = ber(scene)
    if times <= 0:
        change = max(abs(ber(scene, side * epsilon) - middle) for side in (1, -1))
        return change / _half_width(middle, scene.bits)
    z, weight = np.polynomial.hermite_e.hermegauss(_NODES)
    weight = weight / weight.sum()
    rates = np.array([ber(scene, epsilon * float(at)) for at in z])
    mean = float(weight @ rates)
    variance = float(weight @ (rates - mean) ** 2) / max(times, 1.0)
    return float(np.hypot(mean - middle, np.sqrt(variance))) / _half_width(middle, scene.bits)


def flicker_units(scene: LinkSummary, law: Flicker, times: float) -> float:
    """|BER(with) - BER(without)| in half-widths for a random factor of the panel's light.

    The factor is drawn `times` times in the run (at least once), over patches and time. With B(x)
    the error rate at factor x, the result is

        |E B(x) - B(1)| + z sqrt(Var B(x) / times),  z = 3.29 for 99.9 %.

    The first term comes from the curvature of B: half the variance times B'' for weak
    scintillation, whatever the size of the panel. The second is the linear part, which patches
    average out. For independent patches and a correlation in time that is never negative, the
    variance of the mean is not larger: by Hermite's series no function of such a process is
    correlated for longer, and over a time T it leaves at most 2 t_c / T. So the result holds at
    99.9 % for a normal mean.

    It remains an estimate: B is that of `ber`, and cells with data count as uniform over the
    patches. It does not cover single bits at the limit of a decision, nor receivers that fail for
    other reasons.
    """
    if law.index <= 0:
        return 0.0
    z, weight = np.polynomial.hermite_e.hermegauss(_NODES)
    weight = weight / weight.sum()
    normal = np.stack(np.meshgrid(z, z if law.shape else z[:1], indexing="ij"), -1).reshape(-1, 2)
    if law.shape:
        weight = np.multiply.outer(weight, weight).ravel()
    factors = law.factors(normal)
    if law.shape:  # 225 factors: interpolate between 49 rates
        grid = np.geomspace(factors.min(), factors.max(), _FACTORS)
        rates = np.interp(np.log(factors), np.log(grid), _rates(scene, grid))
    else:
        rates = _rates(scene, factors)
    middle = ber(scene)
    mean = float(weight @ rates)
    deviation = math.sqrt(float(weight @ (rates - mean) ** 2) / max(times, 1.0))
    return (abs(mean - middle) + NORMAL * deviation) / _half_width(middle, scene.bits)


def cell_shares(scene: Scene, shape: tuple[int, int], cell: int) -> tuple[tuple[float, ...], ...]:
    """`LinkSummary.shares` for cells of `cell` x `cell` panel pixels in the middle of the panel.

    The sampling is the worst case: four camera pixels, each half a pixel from the cell's middle
    along both axes. Light from beyond the eight neighbours is added to theirs.
    """
    optics = scene.optics
    middle = (optics.width - 1) / 2, (optics.height - 1) / 2
    affine = affine_at(image_of(optics, scene.aim, scene.air, shape), *middle)
    reach = 3
    side = (2 * reach + 1) * cell
    local = np.eye(3)
    local[:2, :2] = affine
    local[:2, 2] = 0.5 - affine @ np.full(2, (side - 1) / 2)
    projection = projection_of(local, (side, side), (2, 2), lens_psf(optics, scene.air.distance))
    shares = np.zeros((4, 9))
    for row in range(2 * reach + 1):
        for column in range(2 * reach + 1):
            plane = np.zeros((side, side), np.float32)
            plane[row * cell : (row + 1) * cell, column * cell : (column + 1) * cell] = 1
            dy, dx = (min(max(n - reach, -1), 1) for n in (row, column))
            place = (3 * dy + dx) % 9
            shares[:, place] += projection(plane).ravel()
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1.0)
    return tuple(tuple(float(x) for x in pixel) for pixel in shares)


def link_summary(
    scene: Scene, camera: CameraSetting, *, cell: int, ticks: int, bits: int, cycles: int
) -> LinkSummary:
    """Summary of a link with all effects.

    A tick shared by two symbols decides nothing, and three ticks decide no worse than more.

    Args:
        scene: panel, optics, aim and air.
        camera: the camera.
        cell: side of a cell of the mode, panel pixels.
        ticks: ticks of a symbol of the mode.
        bits: number of bits decided in the run.
        cycles: length of the run.
    """
    light = levels(scene.optics, scene.air)
    gain = camera.electrons_per_lux * float(camera.clock.period)
    shape = camera.chip.height, camera.chip.width
    on, off = light.on * gain, light.off * gain
    return LinkSummary(
        darkest=off, brightest=on, threshold=camera.threshold, window=1, cycles=cycles,
        spread=camera.spread, planes=1 / ticks, on=on, off=off,
        shares=cell_shares(scene, shape, cell), ticks=min(max(ticks - 1, 1), _TICKS),
        bits=max(bits, 1), noise=camera.threshold_noise, carried=camera.reset != "hard",
    )  # fmt: skip
