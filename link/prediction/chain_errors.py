"""The raw bit error rate of symbols of one tick: decisions of the chain on spikes drawn by their
exact law.

A symbol of one tick shares its ticks with its neighbours, and the charge of earlier symbols decides
about spikes of later ones. So the bits around a decided one matter, and the detector does not know
them: it adds up over all of them, by a forward and a backward pass. No closed form exists for the
error rate of that. Cells, their light and their spikes are drawn here: between two resets charge
only grows, so that a pixel fires in the tick in which its mean charge crosses a threshold drawn
anew for each reset (`link.theory.charge`, by the same cube root of a gamma variable). The tables
are those that the joint detector learns from such spikes, and its chain decides.

Included and not included is what `cell_errors` has; bits before and after are not taken as known.
Beside film at 2 m, rates from 1e-3 on are right within 20 %. With the clock locked it gives 2.5e-4,
and film 3.8e-4 with laws learned from 150 symbols, 5e-4 from the 48 of a training: cells whose
middle is that of a pixel err after long darkness as well, for a reason not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.cores import by_rows
from link.detect.counting import CONTEXT, PAIRS, PHASES, STEEP, WIDE
from link.detect.geometry import PLACES, SHARES
from link.detect.joint import EDGE
from link.detect.tables import LEAST_CHANCE
from link.mode import Mode
from link.prediction.drawn_cells import (
    CellErrors,
    CellSight,
    Flags,
    cell_pixels,
    light_on_pixels,
    own_bits,
    random_bits,
)

_CHARGE: Final = 8
"""Symbols before the chain whose charge may remain."""
_AROUND: Final = 6
"""Symbols of the chain before and after the decided ones: two to each side lose .04 bit at a phase
of .75, six .002."""
_DECIDED: Final = 12
"""Symbols that a chain decides."""
_REPEATS: Final = 8
"""Draws of the spikes under the same light."""
_MOST: Final = 16
"""Largest number of pixels of a cell: those with the largest shares."""
_PRIOR: Final = 8.0
"""Observations that the mean over contexts counts as, in the probability of one context."""
_BATCHES: Final = 16
_ROUNDS, _WANTED = 4, 0.3
"""Largest number of rounds of draws, and the half-width of the interval, over the rate, at which no
more are made."""
_T: Final = 4.073
"""Student's two-sided 99.9 % quantile with _BATCHES - 1 degrees of freedom."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Cells at one sub-pixel position.

    Attributes:
        charge: (cells, pixels, ticks) mean charge of each tick, thresholds.
        bits: (cells, symbols) their bits; symbol n begins in tick n - 1.
        share: (pixels,) class of share.
        phase: (cells,) class of phase.
    """

    charge: Values
    bits: Flags
    share: npt.NDArray[np.intp]
    phase: npt.NDArray[np.intp]


def _draw(
    sight: CellSight, mode: Mode, place: tuple[int, int], count: int, rng: np.random.Generator
) -> _Drawn:
    symbols = _CHARGE + 2 * _AROUND + _DECIDED + 1
    seen = cell_pixels(sight, mode, place, count, _MOST, rng)
    side = 2 * seen.around + 1
    bits = random_bits(rng, (count, side, side, symbols), mode.code.run_limit or symbols)
    light = light_on_pixels(sight, mode.cell, seen, bits)
    delay = rng.choice(sight.phases, count)
    late = delay[:, None, None]
    mean = late * light[..., :-1] + (1 - late) * light[..., 1:]
    charge = sight.scene.background + sight.scene.on * mean
    # A symbol that begins just before a tick counts as one that begins with it, so that the tick
    # belongs to it and not to the next.
    named = delay + EDGE * (np.minimum(delay, 1 - delay) < EDGE)
    mine = own_bits(bits)
    mine = np.where((named >= 1)[:, None], np.roll(mine, 1, axis=1), mine)
    phase = np.minimum((named % 1 * PHASES).astype(np.intp), PHASES - 1)
    return _Drawn(charge, mine, seen.share, phase)


@njit(cache=True, nogil=True)
def _either(a, b):  # type: ignore[no-untyped-def]
    """ln(e^a + e^b) as the detector has it."""
    return max(a, b) + max(STEEP * (WIDE - abs(a - b)), np.float32(0))


@njit(cache=True, nogil=True)
def _spikes(charge, normal, shape, spikes):  # type: ignore[no-untyped-def]
    """Fills spikes, (pixels, ticks) bool, of pixels with hard reset under mean charges. normal:
    (pixels, ticks) standard normal variables, for the threshold from a tick on."""
    for k in range(charge.shape[0]):
        held, threshold = 0.0, 0.0
        for t in range(charge.shape[1]):
            if threshold == 0.0:  # anew after each reset
                root = 1 - 1 / (9 * shape) + normal[k, t] / (3 * math.sqrt(shape))
                threshold = max(root, 1e-3) ** 3
            held += charge[k, t]
            spikes[k, t] = held >= threshold
            if spikes[k, t]:
                held = threshold = 0.0


@njit(cache=True, nogil=True)
def _context(spikes, k, t):  # type: ignore[no-untyped-def]
    """The CONTEXT spikes before tick t, the first one lowest."""
    out = 0
    for j in range(CONTEXT):
        out |= int(spikes[k, t - CONTEXT + j]) << j
    return out


@njit(cache=True, nogil=True)
def _count(c0, c1, charge, normal, bits, share, shape, counts):  # type: ignore[no-untyped-def]
    """Counts spikes of drawn cells by class: (cells, PHASES, SHARES, PAIRS, contexts, 2), of which
    the first axis is summed by the caller."""
    for c in range(c0, c1):
        spikes = np.empty(charge.shape[1:], np.bool_)
        _spikes(charge[c], normal[c], shape, spikes)
        for t in range(_CHARGE, charge.shape[2]):
            pair = 2 * int(bits[c, t]) + int(bits[c, t + 1])
            for k in range(len(share)):
                before = _context(spikes, k, t)
                counts[c, share[k], pair, before, int(spikes[k, t])] += 1


@njit(cache=True, nogil=True)
def _decide(c0, c1, charge, normal, bits, share, phase, tables, shape, wrong, doubt):  # type: ignore[no-untyped-def]
    """Adds up wrong decisions and 1 / (1 + e^|L|) of each cell.

    Args:
        charge, bits, share, phase: charge, bits, share and phase of `_Drawn`.
        normal: (cells, _REPEATS, pixels, ticks) standard normal variables.
        tables: (PHASES, SHARES, PAIRS, contexts, 2) log likelihoods.
        shape: shape of the threshold's gamma law.
        wrong, doubt: (cells,) float64, over _REPEATS draws of _DECIDED symbols.
    """
    first = _CHARGE
    for c in range(c0, c1):
        ticks = charge.shape[2]
        spikes = np.empty(charge.shape[1:], np.bool_)
        gains = np.empty((ticks, PAIRS), np.float32)
        ahead = np.empty(ticks, np.float32)
        for r in range(_REPEATS):
            _spikes(charge[c], normal[c, r], shape, spikes)
            gains[:] = 0
            for t in range(first, ticks):
                for k in range(len(share)):
                    before, spike = _context(spikes, k, t), int(spikes[k, t])
                    for pair in range(PAIRS):
                        gains[t, pair] += tables[phase[c], share[k], pair, before, spike]
            ratio = np.float32(0)
            for t in range(first, ticks):
                g = gains[t]
                ratio = _either(g[1], ratio + g[3]) - _either(g[0], ratio + g[2])
                ahead[t] = ratio
            ratio = np.float32(0)
            for t in range(ticks - 1, first + _AROUND - 1, -1):
                if t < first + _AROUND + _DECIDED:
                    value = ahead[t] + ratio
                    wrong[c] += (value > 0) != bits[c, t + 1]
                    doubt[c] += 1 / (1 + math.exp(abs(value)))
                g = gains[t]
                ratio = _either(g[2], ratio + g[3]) - _either(g[0], ratio + g[1])


def _tables(drawn: list[_Drawn], shape: float, rng: np.random.Generator) -> Values:
    """Log likelihoods that a detector learns, (PHASES, SHARES, PAIRS, contexts, 2)."""
    counts = np.zeros((PHASES, SHARES, PAIRS, 1 << CONTEXT, 2))
    for each in drawn:
        here = np.zeros((len(each.charge), *counts.shape[1:]), np.int32)
        normal = rng.standard_normal(each.charge.shape, np.float32)
        by_rows(_count, len(here), each.charge, normal, each.bits, each.share, shape, here)
        for phase in np.unique(each.phase):
            counts[phase] += here[each.phase == phase].sum(axis=0)
    every = counts.sum(axis=3, keepdims=True)
    prior = (every[..., 1] + 0.5) / (every.sum(-1) + 1)
    chance = (counts[..., 1] + _PRIOR * prior) / (counts.sum(-1) + _PRIOR)
    chance = np.clip(chance, LEAST_CHANCE, 1 - LEAST_CHANCE)
    return np.log(np.stack([1 - chance, chance], axis=-1)).astype(np.float32)


def chain_errors(sight: CellSight, mode: Mode, draws: int = 16_384, seed: int = 1) -> CellErrors:
    """Estimated error rate of cells whose symbols are one tick long.

    Its limits are those of the draws: batches are independent, the decisions in one are not.

    Args:
        sight: the optics and the light.
        mode: mode of the transmission.
        draws: number of cells to draw in a round; each decides _DECIDED symbols _REPEATS times.
        seed: seed of the draws.

    Raises:
        ValueError: for longer symbols.
    """
    if mode.ticks != 1:
        raise ValueError(f"symbols must be of 1 tick, not {mode.ticks}")
    rng = np.random.Generator(np.random.Philox(key=seed))
    q, noise = sight.scene.threshold, sight.scene.noise
    shape = q * q / (q + noise * noise)
    places = [(y, x) for y in range(PLACES) for x in range(PLACES)]
    each = max(draws // len(places) // _BATCHES, 1) * _BATCHES
    tables, batches, doubts = None, [], []
    for _ in range(_ROUNDS):
        drawn = [_draw(sight, mode, place, each, rng) for place in places]
        if tables is None:
            tables = _tables(drawn, shape, rng)
        wrong, doubt = np.zeros((2, len(places), each))
        for n, cells in enumerate(drawn):
            size = each, _REPEATS, *cells.charge.shape[1:]
            by_rows(
                _decide, each, cells.charge, rng.standard_normal(size, np.float32), cells.bits,
                cells.share, cells.phase, tables, shape, wrong[n], doubt[n],
            )  # fmt: skip
        of = _REPEATS * _DECIDED
        batches += [float(b.mean()) / of for b in np.array_split(wrong, _BATCHES, axis=1)]
        doubts.append(float(doubt.mean()) / of)
        rate = float(np.mean(batches))
        half = _T * float(np.std(batches, ddof=1)) / math.sqrt(len(batches))
        if half <= _WANTED * rate:
            break
    return CellErrors(rate, max(rate - half, 0.0), rate + half, float(np.mean(doubts)))
