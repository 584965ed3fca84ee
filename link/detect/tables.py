"""What was seen under known bits, made into what a spike or its absence says of a bit.

The chance of a spike in a tick is taken to depend on the cell's bit, the pixel's class and its own
spikes of the ticks just before (charge that has not fired yet is still there). Three layers, each
the prior of the next one: all of the panel and time, by the share of the tick's light that is the
cell's in this symbol; by share, tick and phase; the same in each region of the panel, whose light
may differ.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from link.detect.counting import CONTEXT, PART, PHASES
from link.detect.geometry import SHARES

__all__ = ["overlap", "parts_for", "spike_counts", "tables"]

_BEFORE: Final = 1 << CONTEXT
_LIGHTS: Final = 32
"""Classes of the share of a tick's light, in the first layer."""
_CLASS_WEIGHT, _REGION_WEIGHT = 8.0, 64.0
"""Observations that a layer's prior counts for in the next one."""
_LEAST: Final = 1e-4
"""Of a chance, and of one minus it: what no table of this size can rule out (a bad pixel, a wrong
place), so that one tick alone never decides."""

Values = npt.NDArray[np.float64]


def parts_for(reads: int) -> int:
    """Parts of PART ticks."""
    return -(-reads // PART)


def overlap(ticks: int, reads: int) -> Values:
    """Share of each tick that the symbol fills, by class of phase: (PHASES, reads)."""
    late = (np.arange(PHASES) + 0.5)[:, None] / PHASES
    at = np.arange(reads)[None, :]
    return np.minimum(np.clip(at + 1 - late, 0, 1), np.clip(ticks + late - at, 0, 1))


def spike_counts(counts: npt.NDArray[np.int32], reads: int) -> Values:
    """From patterns to ticks: (regions, PHASES, reads, SHARES, bits, contexts, spikes)."""
    regions, phases, _, shares, bits, patterns = counts.shape
    shape = (regions, phases, reads, shares, bits, _BEFORE, 2)
    out, seen = np.zeros(shape), np.arange(patterns)
    for j in range(reads):
        part, at = divmod(j, PART)
        before, spike = (seen >> at) & (_BEFORE - 1), (seen >> (at + CONTEXT)) & 1
        for b in range(_BEFORE):
            for s in range(2):
                chosen = counts[:, :, part][..., (before == b) & (spike == s)]
                out[:, :, j, :, :, b, s] = chosen.sum(axis=-1)
    return out


def _chances(counts: Values, prior: Values, weight: float) -> Values:
    """P(spike) with a prior that counts as `weight` observations; spikes are the last axis."""
    return np.asarray((counts[..., 1] + weight * prior) / (counts.sum(axis=-1) + weight))


def _first_layer(counts: Values, light: npt.NDArray[np.intp]) -> Values:
    """P(spike) by share of a tick's light, whether it is a symbol's first tick, bit and context;
    as (PHASES, reads, SHARES, bits, contexts)."""
    pooled = np.zeros((_LIGHTS, 2, 2, _BEFORE, 2))
    total, reads = counts.sum(axis=0), counts.shape[2]
    later = np.broadcast_to((np.arange(reads) > 0).astype(np.intp)[None, :, None], light.shape)
    np.add.at(pooled, (light, later), total)
    # Laplace, and where a share was not met, the nearest one that was
    met = pooled.sum(axis=(2, 3, 4)) > 0
    chance = (pooled[..., 1] + 1) / (pooled.sum(axis=-1) + 2)
    for k in range(2):
        other = met[:, k] if met[:, k].any() else met[:, 1 - k]
        have = np.flatnonzero(other)
        if not len(have):
            continue
        source = k if met[:, k].any() else 1 - k
        near = have[np.abs(np.arange(_LIGHTS)[:, None] - have[None, :]).argmin(axis=1)]
        chance[:, k] = chance[near, source]
    return np.asarray(chance[light, later])


def tables(
    counts: npt.NDArray[np.int32], ticks: int, reads: int
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """(whole, single) of `counting.add_evidence` from counted patterns: ln P(spikes | on) -
    ln P(spikes | off)."""
    each = spike_counts(counts, reads)
    part = (np.arange(SHARES) + 0.5) / SHARES
    light = overlap(ticks, reads)[:, :, None] * part
    first = _first_layer(each, np.minimum(light * _LIGHTS, _LIGHTS - 1).astype(np.intp))
    second = _chances(each.sum(axis=0), first, _CLASS_WEIGHT)
    third = np.clip(_chances(each, second[None], _REGION_WEIGHT), _LEAST, 1 - _LEAST)
    off, on = third[:, :, :, :, 0], third[:, :, :, :, 1]
    single = np.stack([np.log((1 - on) / (1 - off)), np.log(on / off)], axis=-1)
    return _by_pattern(single, reads), single.astype(np.float32)


def _by_pattern(single: Values, reads: int) -> npt.NDArray[np.float32]:
    regions, phases, _, shares = single.shape[:4]
    seen: npt.NDArray[Any] = np.arange(1 << (PART + CONTEXT))
    out = np.zeros((regions, phases, parts_for(reads), shares, seen.size), np.float32)
    for j in range(reads):
        part, at = divmod(j, PART)
        before, spike = (seen >> at) & (_BEFORE - 1), (seen >> (at + CONTEXT)) & 1
        out[:, :, part] += single[:, :, j][..., before, spike].astype(np.float32)
    return out
