"""What bounds of a link's effects read, and the unit they end in.

The error of a link's simulation is |BER(with) - BER(without)| over half the width of the 99.9 %
interval of the bit error rate over the run's bits (Clopper and Pearson, Biometrika 26:404, 1934).
Each effect first bounds by how much it can change a pixel's charge in a tick; `ber_units` makes the
unit of it, by the closed form of the pixel: with reset to zero it fires where Poisson electrons
reach the threshold, with the residual carried that is as likely in any phase of the charge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Summary
from link.air.air import lens_psf
from link.air.geometry import affine_at, image_of
from link.air.names import Scene
from link.air.projection import Projection
from link.air.radiometry import levels
from link.air.scintillation import Flicker
from sensor import CameraSetting

__all__ = ["LinkSummary", "ber", "ber_units", "flicker_units", "link_summary"]

Values = npt.NDArray[np.float64]
_RISK: Final = 0.001
"""Of the interval: 99.9 %."""
_DEVIATIONS: Final = 3.29
"""Of a normal quantity, within which 99.9 % lie."""
_NODES: Final = 15
_FACTORS: Final = 49
_TICKS: Final = 3
"""At most that are taken to decide a bit: fewer make more errors."""


@dataclass(frozen=True)
class LinkSummary(Summary):
    """on, off: electrons a tick of a pixel well within a part that is on, or off. shares: (pixels,
    cells) of the light of the pixels that decide a cell, that is the cell's own, first, and that is
    its eight neighbours'. ticks: that decide it. bits: of the run. noise: of the threshold,
    electrons. carried: whether the residual is."""

    on: float = 0.0
    off: float = 0.0
    shares: tuple[tuple[float, ...], ...] = ((1.0,),)
    ticks: int = 1
    bits: int = 1
    noise: float = 0.0
    carried: bool = False


def _fires(scene: LinkSummary, electrons: Values) -> Values:
    """Chance that a tick's flag is set."""
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
    """Chance of each outcome, (ticks + 1) ^ pixels, of flags that pixels set in so many ticks, the
    mean over neighbours' patterns. chances: (patterns, pixels) of a flag in a tick."""
    counts = np.arange(ticks + 1)
    ways = np.array([math.comb(ticks, n) for n in counts])
    p = chances[..., None]
    each = ways * p**counts * (1 - p) ** counts[::-1]  # (patterns, pixels, counts)
    out = each[:, 0]
    for pixel in range(1, each.shape[1]):
        out = (out[:, :, None] * each[:, pixel, None, :]).reshape(len(each), -1)
    return np.asarray(out.mean(axis=0))


def _both(scene: LinkSummary, epsilon: float, gain: float) -> tuple[Values, Values]:
    """Chance of each outcome of a cell that is on, and of one that is off; see `ber`."""
    shares = np.array(scene.shares)
    neighbours = shares.shape[1] - 1
    patterns = np.arange(1 << neighbours)[:, None] >> np.arange(neighbours) & 1
    others = patterns @ shares[:, 1:].T  # (patterns, pixels)
    swing = (scene.on - scene.off) * gain
    # Charges that have met can only pass each other, and then tell of the bit again.
    wrong = np.minimum(epsilon * scene.on, swing * shares[:, 0] / 2)
    on, off = (
        _outcomes(_fires(scene, scene.off + swing * light + more), scene.ticks)
        for light, more in ((others + shares[:, 0], -wrong), (others, wrong))
    )
    return on, off


def ber(scene: LinkSummary, epsilon: float = 0.0) -> float:
    """Bit error rate of the best decision by the flags of the pixels and ticks that decide a cell,
    its neighbours showing what they will. epsilon: of the charge of a pixel that is on, by which
    all charges are wrong, the way that makes errors likelier (above 0) or rarer."""
    return float(min(np.minimum(*_both(scene, epsilon, 1.0)).sum() / 2, 0.5))


def _rates(scene: LinkSummary, factors: Values) -> Values:
    """(n,) bit error rates where all of the panel's light, of on and off alike, is times each of
    (n,) factors, which the decision does not know: it is the best one at 1."""
    is_on = np.greater(*_both(scene, 0.0, 1.0))
    both = (_both(scene, 0.0, float(factor)) for factor in factors)
    return np.array([np.where(is_on, off, on).sum() / 2 for on, off in both])


def _half_width(rate: float, bits: int) -> float:
    from scipy.stats import beta

    errors = round(rate * bits)
    low = beta.ppf(_RISK / 2, errors, bits - errors + 1) if errors else 0.0
    high = beta.ppf(1 - _RISK / 2, errors + 1, bits - errors) if errors < bits else 1.0
    return float(high - low) / 2


def ber_units(scene: LinkSummary, epsilon: float, times: float = 0.0) -> float:
    """|BER(with) - BER(without)| in half-widths, where every charge changes by no more than
    `epsilon` of that of a pixel that is on, at most: errors are the rarer the more the charges of
    on and off differ, so the ends of what these may become bound all between.

    An estimate, however sure `epsilon` is: of the rate of `ber`'s own decision by a few pixels in
    the panel's middle, not of a receiver's, and over the half-width at `ber`'s own rate.

    times: where above 0, `epsilon` is a standard deviation instead, of a change that comes anew so
    often in the run (at least once); the RMS of what it does to the run's rate.
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
    """|BER(with) - BER(without)| in half-widths, of a factor of the panel's light that comes anew
    `times` times in the run (at least once), from patch to patch and in time, B(x) the rate at x:

        |E B(x) - B(1)| + z sqrt(Var B(x) / times),  z = 3.29 of 99.9 %.

    The first is what bending makes of the flicker, half its variance times B'' where it is weak,
    and stays however large the panel; the second is the linear part, which patches average. For
    patches on their own and a correlation in time that is never below 0 the variance of the mean is
    no more (by Hermite's series no function of such a course is correlated longer, and over T it
    leaves at most 2 t_c / T), so it holds at 99.9 % for a normal mean.

    An estimate all the same: B is `ber`'s, of a decision in the panel's middle that knows nothing
    of the factor; cells with data count as even over the patches. Of bits at the edge that fall one
    way or the other by chance it says nothing, nor of a receiver that errs for other reasons.
    """
    if law.index <= 0:
        return 0.0
    z, weight = np.polynomial.hermite_e.hermegauss(_NODES)
    weight = weight / weight.sum()
    normal = np.stack(np.meshgrid(z, z if law.shape else z[:1], indexing="ij"), -1).reshape(-1, 2)
    if law.shape:
        weight = np.multiply.outer(weight, weight).ravel()
    factors = law.factors(normal)
    if law.shape:  # 225 of them: between 49 rates
        grid = np.geomspace(factors.min(), factors.max(), _FACTORS)
        rates = np.interp(np.log(factors), np.log(grid), _rates(scene, grid))
    else:
        rates = _rates(scene, factors)
    middle = ber(scene)
    mean = float(weight @ rates)
    deviation = math.sqrt(float(weight @ (rates - mean) ** 2) / max(times, 1.0))
    return (abs(mean - middle) + _DEVIATIONS * deviation) / _half_width(middle, scene.bits)


def cell_shares(scene: Scene, shape: tuple[int, int], cell: int) -> tuple[tuple[float, ...], ...]:
    """`LinkSummary.shares` of cells of so many panel pixels in the middle of the panel, where the
    sampling is at its worst: four camera pixels half a pixel from the cell's middle along each
    axis. What is further away than the eight neighbours counts to them."""
    optics = scene.optics
    middle = (optics.width - 1) / 2, (optics.height - 1) / 2
    affine = affine_at(image_of(optics, scene.aim, scene.air, shape), *middle)
    reach = 3
    side = (2 * reach + 1) * cell
    local = np.eye(3)
    local[:2, :2] = affine
    local[:2, 2] = 0.5 - affine @ np.full(2, (side - 1) / 2)
    projection = Projection(local, (side, side), (2, 2), lens_psf(optics, scene.air.distance))
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
    """Of a link as it is in full. cell, ticks: of the mode. bits: that are decided in the run. A
    tick in which symbols meet decides nothing, and three decide no worse than more."""
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
