"""Cases 5, 6 and 19: laws of the noise where they are at their most extreme, and independence.

Every statistic is put at one in a million: |z| < 4.9, or 6 decades of a p-value.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from cosim.run.case import Case
from sensor import EFFECTS, make_pixels
from sensor.circuit.circuit import ktc_electrons
from sensor.latched.effects import RESIDUAL, SHOT_NOISE
from sensor.latched.pixel.charge import ONE, Span
from sensor.latched.pixel.model import ExactModel, PixelState
from sensor.stability.gathering import Counts

Z: Final = 4.9
"""Standard deviations that a normal variate passes once in a million."""
DECADES: Final = 6.0


def decades_of_chi_square(
    observed: npt.NDArray[np.float64], expected: npt.NDArray[np.float64]
) -> float:
    """-log10 of the p-value, classes of less than 5 expected put together."""
    from scipy.stats import chi2

    big = expected >= 5
    seen = np.append(observed[big], observed[~big].sum())
    law = np.append(expected[big], expected[~big].sum())
    if law[-1] < 5:
        seen[-2] += seen[-1]
        law[-2] += law[-1]
        seen, law = seen[:-1], law[:-1]
    statistic = float(((seen - law) ** 2 / law).sum())
    return float(-chi2.logsf(statistic, law.size - 1) / math.log(10))


# 5 -------------------------------------------------------------------------------------------

Window = Callable[[int, float, int], Counts]
"""(pixels, electrons a cycle, cycles) -> thresholds of one electron that each has reached."""


def _window(device: Device | None) -> Window:
    def window(n: int, electrons: float, cycles: int) -> Counts:
        model = ExactModel(1.0, 21, (RESIDUAL, SHOT_NOISE))
        pixels = make_pixels(model, np.arange(n, dtype=np.uint32), device)
        charge = np.full(n, round(electrons * ONE), np.int64)
        pixels.expose([Span(0, cycles, charge)], cycles)
        return pixels.state().spikes.astype(np.int64)

    return window


def poisson_law(window: Window, n: int = 1_000_000) -> float:
    """Decades of the p-value of counts against the Poisson probabilities e^-m m^k / k!."""
    decades = []
    for electrons, cycles in ((0.1, 3), (0.1, 64), (0.4, 64)):
        mean = electrons * cycles
        counts = window(n, electrons, cycles)
        k = np.arange(int(counts.max()) + 2)
        law = np.array([math.exp(i * math.log(mean) - mean - math.lgamma(i + 1)) for i in k])
        law[-1] += 1 - law.sum()
        observed = np.bincount(counts, minlength=k.size).astype(np.float64)
        decades.append(decades_of_chi_square(observed, n * law))
    return max(decades)


# 6 -------------------------------------------------------------------------------------------

Refires = Callable[[int, float, float], Counts]
"""(pixels, threshold, noise in electrons) -> spikes of one instant, of pixels that are full."""
ENDLESS: Final = 1000
"""Spikes of one instant that count as endless."""


def _refires(device: Device | None) -> Refires:
    def refires(n: int, threshold: float, sigma: float) -> Counts:
        model = ExactModel(threshold, 11, (RESIDUAL,), threshold_noise=sigma)
        pixels = make_pixels(model, np.arange(n, dtype=np.uint32), device)
        pixels.restore(PixelState(np.zeros(n, np.int64), np.zeros(n, np.uint64)))
        # One unit of charge makes a pixel fire whose deficit is 0. What comes beside it is below
        # 1e-6 e, so it reaches only thresholds that were drawn below zero.
        pixels.expose([Span(0, 1, np.full(n, 1 << 20, np.int64))], 1)
        return pixels.state().spikes.astype(np.int64)

    return refires


def refiring(refires: Refires, n: int = 1_000_000) -> float:
    """Largest |z| of the share that fires again at once against Phi(-Q / sigma), and of the share
    of those that does so once more; infinite where it does not end."""
    sigma, worst = ktc_electrons(5e-15, 300.0), 0.0
    for ratio in (1.0, 2.0, 3.0):
        spikes = refires(n, ratio * sigma, sigma)
        if spikes.min() < 1 or spikes.max() >= ENDLESS:
            return math.inf
        p = 0.5 * math.erfc(ratio / math.sqrt(2))
        first, again, third = (int((spikes >= k).sum()) for k in (1, 2, 3))
        for seen, of in ((again, first), (third, again)):
            worst = max(worst, abs(seen - of * p) / math.sqrt(of * p * (1 - p)))
    return worst


# 19 ------------------------------------------------------------------------------------------

Draw = Callable[[npt.NDArray[np.int64], int, int, Stream], npt.NDArray[np.float64]]
"""(pixels, index, seed, stream) -> one number for each pixel."""


def _draw(device: Device | None) -> Draw:
    """Random words in the shape in which every effect takes them; thresholds as the pixel draws
    them."""

    def draw(
        pixels: npt.NDArray[np.int64], index: int, seed: int, stream: Stream
    ) -> npt.NDArray[np.float64]:
        if stream is Stream.SHOT_NOISE:
            model = ExactModel(1000.0, seed, tuple(EFFECTS.values()))
            made = make_pixels(model, pixels.astype(np.uint32), device)
            full = PixelState(np.zeros(pixels.size, np.int64), np.full(pixels.size, index - 1))
            full.spikes = full.spikes.astype(np.uint64)
            made.restore(full)
            made.expose([Span(0, 1, np.ones(pixels.size, np.int64))], 1)
            return made.state().deficit / ONE
        words = philox4x32((pixels, index >> 34, index >> 2 & 0xFFFFFFFF, 0), (seed, stream))
        return words[index & 3] / 2.0**32

    return draw


def independence(draw: Draw, n: int = 400_000) -> float:
    """Largest |z| of the correlation over pixels, of fixed pairs of pixel, index, seed, stream."""
    pixels = np.arange(n)
    base = draw(pixels, 1, 1, Stream.SHOT_NOISE)
    sets = [base, draw(pixels + 1, 1, 1, Stream.SHOT_NOISE)]
    sets.append(draw(pixels + 1000, 1, 1, Stream.SHOT_NOISE))
    sets += [draw(pixels, k, 1, Stream.SHOT_NOISE) for k in (2, 3, 4, 5, 2**32 + 1, 2**34 + 1)]
    sets += [draw(pixels, 1, seed, Stream.SHOT_NOISE) for seed in (2, 3, 2**31)]
    sets += [draw(pixels, 1, 1, s) for s in Stream if s not in (Stream.NONE, Stream.SHOT_NOISE)]
    sets += [draw(pixels, 2, 2, Stream.INITIAL_CHARGE), draw(pixels, 1, 16, Stream.SHOT_NOISE)]
    scores = [(s - s.mean()) / s.std() for s in sets]
    return max(abs(float((a * b).mean())) * math.sqrt(n) for a, b in combinations(scores, 2))


CHANCE: Final = (
    Case(
        5,
        "threshold of one electron",
        "counts of a window have the Poisson law",
        "e^-m m^k / k!",
        "normal thresholds",
        "decades of p",
        DECADES,
        poisson_law,
        _window,
        {"n": 50_000},
    ),
    Case(
        6,
        "threshold at the kTC noise",
        "no endless refire at 28.4 e; a spike is followed at once with probability Phi(-Q/sigma)",
        "erfc",
        "reset noise drawn once for each pixel",
        "|z|",
        Z,
        refiring,
        _refires,
        {"n": 200_000},
    ),
    Case(
        19,
        "independence of streams",
        "|z| < 4.9 of every pair of pixels, cycles, seeds and effects",
        "correlation 0",
        "seed + stream as key",
        "|z|",
        Z,
        independence,
        _draw,
        {"n": 100_000},
    ),
)
