"""Log likelihoods of spikes, estimated from counts under known bits.

The probability of a spike in a tick is modelled as a function of the bits of the symbol and of the
previous one, of the pixel's class, and of the pixel's spikes in the preceding ticks, which indicate
the charge that remains. Three layers are estimated, each the prior of the next: over the whole
panel and all time, by the share of the pixel's light from the cell and the part of the tick in
which it is on; by share, tick and phase; the same in each region of the panel, where the light may
differ.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from link.detect.counting import CONTEXT, PAIRS, PART, PHASES
from link.detect.geometry import SHARES

_BEFORE: Final = 1 << CONTEXT
_STEPS: Final = 32
"""Classes of the part of a tick in which a cell is on, in the first layer."""
_CLASS_WEIGHT, _REGION_WEIGHT = 8.0, 64.0
"""Number of observations that the prior of a layer counts as in the next one."""
LEAST_CHANCE: Final = 1e-4
"""Smallest probability of a spike and of its absence. Rarer causes (a defective pixel, a wrong
position) cannot be excluded from so few counts, so one tick alone never decides."""

Values = npt.NDArray[np.float64]
Tables = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]


def parts_for(ticks: int) -> int:
    """Number of parts of PART ticks."""
    return -(-ticks // PART)


def lit(ticks: int) -> Values:
    """Part of each tick in which the cell is on, (PHASES, ticks, PAIRS).

    The axes are the class of phase, the tick, and the bits before and after the symbol begins.
    """
    delay = ((np.arange(PHASES) + 0.5) / PHASES)[:, None, None]
    first = (np.arange(ticks) == 0)[None, :, None]
    pair = np.arange(PAIRS)
    return np.where(first, delay * (pair // 2) + (1 - delay) * (pair % 2), pair % 2)


def spike_counts(counts: npt.NDArray[np.int32], ticks: int) -> Values:
    """Converts counts of patterns to counts of spikes in each tick.

    Returns:
        (regions, PHASES, ticks, SHARES, PAIRS, contexts, spikes) float64.
    """
    regions, phases, _, shares, pairs, patterns = counts.shape
    out = np.zeros((regions, phases, ticks, shares, pairs, _BEFORE, 2))
    pattern = np.arange(patterns)
    for j in range(ticks):
        part, at = divmod(j, PART)
        before, spike = (pattern >> at) & (_BEFORE - 1), (pattern >> (at + CONTEXT)) & 1
        for b in range(_BEFORE):
            for s in range(2):
                chosen = counts[:, :, part][..., (before == b) & (spike == s)]
                out[:, :, j, :, :, b, s] = chosen.sum(axis=-1)
    return out


def _chances(counts: Values, prior: Values, weight: float) -> Values:
    """P(spike) with a prior that counts as `weight` observations; the last axis is the spike."""
    return np.asarray((counts[..., 1] + weight * prior) / (counts.sum(axis=-1) + weight))


def _first_layer(counts: Values, ticks: int) -> Values:
    """P(spike) by share, lit part of the tick, and context, interpolated over lit parts.

    Args:
        counts: (PHASES, ticks, SHARES, PAIRS, contexts, spikes), over the panel.
        ticks: ticks of a symbol.

    Returns:
        (PHASES, ticks, SHARES, PAIRS, contexts) float64.
    """
    on = lit(ticks)
    step = np.minimum((on * _STEPS).astype(np.intp), _STEPS - 1)
    met = np.zeros((_STEPS, SHARES, _BEFORE, 2))
    np.add.at(met, step.ravel(), counts.transpose(0, 1, 3, 2, 4, 5).reshape(-1, *met.shape[1:]))
    # A share without counts takes the mean of the others, and so does a context: the training lacks
    # some runs of bits, and so some patterns of preceding spikes.
    every = met.sum(axis=1, keepdims=True)
    all_of_it = every.sum(axis=2, keepdims=True)
    mean = (all_of_it[..., 1] + 1) / (all_of_it.sum(-1) + 2)
    chance = _chances(met, _chances(every, mean, _CLASS_WEIGHT), _CLASS_WEIGHT)
    have = np.flatnonzero(every.sum(axis=(1, 2, 3)))
    out = np.empty((*step.shape, SHARES, _BEFORE))
    for s in range(SHARES):
        for b in range(_BEFORE):
            out[..., s, b] = np.interp(step, have, chance[have, s, b])
    return np.moveaxis(out, 3, 2)


def tables(counts: npt.NDArray[np.int32], ticks: int) -> Tables:
    """(whole, single) of `counting.add_evidence` from counts of patterns.

    The values are ln P(spikes | bits) minus that for both bits off.
    """
    each = spike_counts(counts, ticks)
    pooled = each.sum(axis=0)
    second = _chances(pooled, _first_layer(pooled, ticks), _CLASS_WEIGHT)
    third = np.clip(_chances(each, second[None], _REGION_WEIGHT), LEAST_CHANCE, 1 - LEAST_CHANCE)
    logs = np.log(np.stack([1 - third, third], axis=-1))  # ..., PAIRS, contexts, spikes
    single = np.moveaxis(logs, 4, -1)
    single = np.ascontiguousarray(single - single[..., :1], np.float32)
    return _by_pattern(single, ticks), single


def _by_pattern(single: npt.NDArray[np.float32], ticks: int) -> npt.NDArray[np.float32]:
    regions, phases, _, shares = single.shape[:4]
    pattern: npt.NDArray[Any] = np.arange(1 << (PART + CONTEXT))
    out = np.zeros((regions, phases, parts_for(ticks), shares, pattern.size, PAIRS), np.float32)
    for j in range(ticks):
        part, at = divmod(j, PART)
        before, spike = (pattern >> at) & (_BEFORE - 1), (pattern >> (at + CONTEXT)) & 1
        out[:, :, part] += single[:, :, j][:, :, :, before, spike]
    return out
