"""The raw bit error rate of the joint decision, from the exact law of spikes under random light.

A cell's pixels also receive light of neighbouring cells. Given all bits, the pixels of a sensor
with hard reset spike independently, with a closed-form law (`link.theory.hard_patterns`), and so
does the sum of their log likelihood ratios. The positions of cells between the pixels, on an even
grid, and the bits of neighbouring and previous cells are drawn at random. This is a semi-analytic
estimate (Jeruchim, IEEE J. Sel. Areas Commun. 2:153, 1984): it counts no errors, so few draws
suffice for rare ones. The ratios are those that the joint detector learns: of single ticks, by
class of phase, share of the light, the cell's bit and the previous one, and the pixel's two
preceding spikes, averaged over the bits of other cells. The bits before and after are taken as
known.

Included: shot and threshold noise, blur, crosstalk, position of cells between the pixels, light of
neighbouring cells (common to all pixels and ticks of a symbol), carried charge, ticks shared by two
symbols, run lengths of the line code, the phase of every row. Not included: errors of the
receiver's estimates (position, phase, laws learned from few symbols), fixed pattern, scintillation,
rotated cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.detect.counting import PHASES
from link.detect.geometry import PLACES, SHARES
from link.detect.tables import LEAST_CHANCE
from link.mode import Mode
from link.prediction.drawn_cells import (
    CellErrors,
    CellSight,
    cell_pixels,
    light_on_pixels,
    own_bits,
    random_bits,
)
from link.prediction.error_bound import longest_run
from link.theory import hard_patterns

_HISTORY: Final = 4
"""Symbols before the decided one whose charge may remain."""
_CONTEXT: Final = 2
_STEP, _BINS = 0.75, 512
"""Step and size of the grid of log likelihood ratios."""
_MOST: Final = 16
"""Largest number of pixels of a cell: those with the largest shares."""
_AGAINST: Final = 0.8
"""Probability that a neighbouring cell shows the opposite bit, in half of the draws (importance
sampling)."""
_BATCHES: Final = 16
"""Number of batches that the interval is computed from."""
_PRIOR: Final = 1.0
"""Number of drawn pixels that the mean over contexts counts as, in the probability of one
context."""
_ROUNDS: Final = 12
"""Largest number of rounds of draws."""
_T: Final = 4.073
"""Student's two-sided 99.9 % quantile with 15 degrees of freedom."""
Values = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


def _importance_sample(rng: np.random.Generator, bits: Flags, around: int) -> Values:
    """Flips bits of the eight neighbouring cells, in place, and returns the weights of the draws.

    In half of the draws, neighbours more often show the opposite of the cell's bit, since that
    causes most errors.
    """
    count = len(bits)
    neighbours = bits[:, around - 1 : around + 2, around - 1 : around + 2].reshape(count, 9, -1)
    neighbours = np.delete(neighbours, 4, axis=1)
    chance = np.where(np.arange(count) % 2, _AGAINST, 0.5)[:, None]
    against = rng.random((count, 8)) < chance
    bit = bits[:, around, around, -2]
    turned = (neighbours[:, :, -2] != bit[:, None]) != against
    flip = np.zeros((count, 9), np.bool_)
    flip[:, [0, 1, 2, 3, 5, 6, 7, 8]] = turned
    part = bits[:, around - 1 : around + 2, around - 1 : around + 2]
    part ^= flip.reshape(count, 3, 3, 1)
    n = against.sum(axis=1)
    weight = 2 / (1 + (2 * _AGAINST) ** n * (2 - 2 * _AGAINST) ** (8 - n))
    return np.asarray(weight / weight.mean())


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Drawn cells at one sub-pixel position.

    Attributes:
        patterns: (cells, pixels, 2^window) probabilities of the spikes.
        weight: (cells,) mean 1.
        bit, before, after: (cells,) bits of the decided, the previous and the next symbol.
        share: (pixels,) class of share.
        phase: (cells,) class of the phase at which symbols begin in a tick.
    """

    patterns: Values
    weight: Values
    bit: Flags
    before: Flags
    after: Flags
    share: npt.NDArray[np.intp]
    phase: npt.NDArray[np.intp]


def _draw(
    sight: CellSight, mode: Mode, place: tuple[int, int], count: int, rng: np.random.Generator
) -> _Drawn:
    """Draws cells at one of the detector's sub-pixel positions."""
    scene, ticks = sight.scene, mode.ticks
    symbols = _HISTORY + 3
    seen = cell_pixels(sight, mode, place, count, _MOST, rng)
    side = 2 * seen.around + 1
    bits = random_bits(rng, (count, side, side, symbols), longest_run(mode))
    weight = _importance_sample(rng, bits, seen.around)
    light = light_on_pixels(sight, mode.cell, seen, bits)
    # Symbol 0 contributes only to the first tick, and of the last symbol only one tick is read.
    delay = rng.choice(sight.phases, count)[:, None]
    means = np.empty((count, len(seen.share), (_HISTORY + 1) * ticks + 1))
    for n in range(1, symbols):
        first = (n - 1) * ticks
        means[..., first] = delay * light[..., n - 1] + (1 - delay) * light[..., n]
        if n < symbols - 1:
            means[..., first + 1 : first + ticks] = light[..., n, None]
    patterns = hard_patterns(
        scene.background + scene.on * means, _CONTEXT + ticks + 1, scene.threshold, scene.noise
    )
    mine = own_bits(bits)
    phase = np.minimum((delay[:, 0] * PHASES).astype(np.intp), PHASES - 1)
    return _Drawn(patterns, weight, mine[:, -2], mine[:, -3], mine[:, -1], seen.share, phase)


def _tables(drawn: list[_Drawn], ticks: int) -> Values:
    """ln P(spike) as the detector learns it.

    The shape is (PHASES, ticks, shares, before, bit, contexts, spike).
    """
    patterns = np.arange(1 << (_CONTEXT + ticks + 1))
    counts = np.zeros((PHASES, ticks, SHARES, 2, 2, 1 << _CONTEXT, 2))
    for each in drawn:
        law = np.zeros((PHASES, 2, 2, *each.patterns.shape[1:]))  # by phase, before and bit
        place = each.phase, each.before.astype(int), each.bit.astype(int)
        np.add.at(law, place, each.weight[:, None, None] * each.patterns)
        for j in range(ticks):
            at = 2 * ((patterns >> j) & 3) + ((patterns >> (j + _CONTEXT)) & 1)
            told = law @ np.eye(2 << _CONTEXT)[at]  # by context and spike
            for k, s in enumerate(each.share):
                counts[:, j, s] += told[..., k, :].reshape(PHASES, 2, 2, -1, 2)
    every = counts.sum(axis=-2, keepdims=True)  # prior of rare contexts
    prior = (every[..., 1] + 1e-9 / 2) / (every.sum(-1) + 1e-9)
    chance = (counts[..., 1] + _PRIOR * prior) / (counts.sum(-1) + _PRIOR)
    chance = np.clip(chance, LEAST_CHANCE, 1 - LEAST_CHANCE)
    return np.log(np.stack([1 - chance, chance], axis=-1))


def _wrong(each: _Drawn, tables: Values, ticks: int) -> tuple[Values, Values]:
    """P(wrong decision) and the rate according to the soft values, (cells,) each."""
    patterns = np.arange(1 << (_CONTEXT + ticks + 1))
    ratio = np.zeros((PHASES, 2, 2, each.share.size, patterns.size))  # by before and after
    for j in range(ticks + 1):
        context, spike = (patterns >> j) & 3, (patterns >> (j + _CONTEXT)) & 1
        for before in range(2):
            for after in range(2):
                if j < ticks:
                    on, off = (tables[:, j, each.share, before, bit] for bit in (1, 0))
                else:  # the next symbol begins
                    on, off = (tables[:, 0, each.share, bit, after] for bit in (1, 0))
                ratio[:, before, after] += (on - off)[..., context, spike]
    most = (_BINS // 2 - 1) // each.share.size  # sums do not wrap around
    bins = np.clip(np.rint(ratio / _STEP), -most, most).astype(np.intp) + most
    value = np.fft.ifftshift(np.arange(_BINS) - _BINS // 2) * _STEP
    # From the sum's characteristic function: P(below 0) + P(0) / 2, and the mean of
    # 1 / (1 + e^|L|).
    below = np.fft.rfft((value < 0) + 0.5 * (value == 0))
    above = np.fft.rfft((value > 0) + 0.5 * (value == 0))
    doubt = np.fft.rfft(1 / (1 + np.exp(np.abs(value))))
    twice = np.full(below.size, 2.0 / _BINS)
    twice[[0, -1]] /= 2
    wave = -2j * np.pi / _BINS * np.arange(below.size)
    # Of each ratio, (ratios, 2 frequencies): real and imaginary parts.
    turn = np.exp(np.arange(-most, most + 1.0)[:, None] * wave).view(np.float64)
    wrong, promise = np.empty(each.bit.size), np.empty(each.bit.size)
    kinds = np.stack([each.phase, each.before, each.after], axis=1).astype(np.intp)
    for kind in np.unique(kinds, axis=0):
        these = np.flatnonzero((kinds == kind).all(axis=1))
        spectrum = np.ones((these.size, below.size), np.complex128)
        for k, at in enumerate(bins[tuple(kind)]):
            law = each.patterns[these, k] @ turn[at]
            spectrum *= law.view(np.complex128)
        sums = (spectrum @ (twice * np.stack([above, below, doubt]).conj()).T).real
        wrong[these] = np.where(each.bit[these], sums[:, 1], sums[:, 0])
        promise[these] = sums[:, 2]
    return np.maximum(wrong, 0.0) * each.weight, promise * each.weight


def cell_errors(sight: CellSight, mode: Mode, draws: int = 8_192, seed: int = 1) -> CellErrors:
    """Estimated error rate of cells.

    Draws are repeated, at most `_ROUNDS` times, until the interval is narrower than the rate.

    Args:
        sight: the optics and the light.
        mode: mode of the transmission.
        draws: number of cells to draw, reduced for long symbols.
        seed: seed of the draws.
    """
    rng = np.random.Generator(np.random.Philox(key=seed))
    places = [(y, x) for y in range(PLACES) for x in range(PLACES)]
    each = max(draws * 32 // len(places) >> (_CONTEXT + mode.ticks + 1), _BATCHES)
    tables, batches, promises = None, [], []
    for _ in range(_ROUNDS):
        drawn = [_draw(sight, mode, place, each, rng) for place in places]
        tables = _tables(drawn, mode.ticks) if tables is None else tables
        both = [_wrong(d, tables, mode.ticks) for d in drawn]
        wrong = np.stack([w for w, _ in both])
        batches += [float(b.mean()) for b in np.array_split(wrong, _BATCHES, axis=1)]
        promises += [float(p.mean()) for _, p in both]
        rate = float(np.mean(batches))
        half = _T * float(np.std(batches, ddof=1)) / math.sqrt(len(batches))
        if half <= rate:
            break
    return CellErrors(rate, max(rate - half, 0.0), rate + half, float(np.mean(promises)))
