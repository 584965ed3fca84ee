"""The loops of belief propagation: charge of a camera pixel, and the cells in its footprint.

Kschischang, Frey and Loeliger, "Factor graphs and the sum-product algorithm", IEEE Trans. IT 47:498
(2001). A factor is a camera pixel in a symbol; its variables are the bits of the cells that it
sees, and its charge before and after the symbol. All messages of charge are distributions on a
grid, all messages of bits log likelihood ratios.

Arrays are passed one by one: numba vectorises these loops only for plain array arguments.
"""

from __future__ import annotations

from math import exp, log
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int64]
LEVELS: Final = 48
"""Steps of charge in a threshold."""
LIGHTS: Final = 64
"""Steps of a tick's light in a threshold, at which the law of the spikes is computed."""
_FINE: Final = 2
"""Steps of light of the charge laws, to a step of LIGHTS."""
TAPS: Final = 16
"""States that a tick's charge is spread over: four standard deviations to each side at two
thresholds of light; what is brighter fires in any case."""
_LEAST: Final = np.float32(1e-5)
"""Probability of a state below which it is dropped, over the whole."""


@njit(cache=True, nogil=True)
def tick(charge, low, high, light, spike, kernel, first, fires, hard, after):  # type: ignore[no-untyped-def]
    """Carries a distribution of charge through a tick; returns the range of what it becomes.

    Args:
        charge: (states,) float32 before the tick, zero but from `low` to `high`.
        light: light of the tick, thresholds.
        spike: whether the pixel fired.
        kernel, first: kernel and first bin of `laws`.
        fires: (states,) float32, probability of a spike by the charge at the end of the tick.
        hard: whether a spike removes all charge, not just a threshold.
        after: (states,) float32, overwritten.
    """
    most = charge.size - TAPS
    q = min(max(int(light * (LIGHTS * _FINE) + np.float32(0.5)), 0), first.size - 1)
    begin, stop = min(low + first[q], most), min(high - 1 + first[q], most) + TAPS
    after[:] = np.float32(0.0)
    for g in range(low, high):
        mass, at = charge[g], min(g + first[q], most)  # what the grid cannot hold stays on its end
        for t in range(TAPS):
            after[at + t] += mass * kernel[q, t]
    if not spike:
        for g in range(begin, stop):
            after[g] *= np.float32(1.0) - fires[g]
        return begin, stop
    if hard:
        total = np.float32(0.0)
        for g in range(begin, stop):
            total += after[g] * fires[g]
            after[g] = np.float32(0.0)
        after[0] = total
        return 0, 1
    for g in range(begin, stop):
        mass = after[g] * fires[g]
        after[g] = np.float32(0.0)
        after[max(g - LEVELS, 0)] += mass  # in ascending order: never a state still to be read
    return max(begin - LEVELS, 0), max(stop - LEVELS, 1)


@njit(cache=True, nogil=True)
def tick_back(later, light, spike, kernel, first, fires, hard, before):  # type: ignore[no-untyped-def]
    """Carries the probability of all later spikes, given the charge, back through a tick.

    Args:
        later: (states,) float32, given the charge after the tick.
        before: (states,) float32, overwritten: given the charge before it.
        light, spike, kernel, first, fires, hard: light, spike, kernel, first, fires and hard as for
            `tick`.
    """
    states = later.size
    q = min(max(int(light * (LIGHTS * _FINE) + np.float32(0.5)), 0), first.size - 1)
    weight = np.empty(states, np.float32)
    for g in range(states):
        if not spike:
            weight[g] = (np.float32(1.0) - fires[g]) * later[g]
        else:
            weight[g] = fires[g] * later[0 if hard else max(g - LEVELS, 0)]
    for g in range(states):
        total, at = np.float32(0.0), min(g + first[q], states - TAPS)
        for t in range(TAPS):
            total += kernel[q, t] * weight[at + t]
        before[g] = total


@njit(cache=True, nogil=True)
def shared(light, number, ticks, late, last, next_):  # type: ignore[no-untyped-def]
    """Light of a tick of a symbol, thresholds.

    Args:
        light: light of the symbol.
        number, ticks: number of the tick, and ticks of the symbol.
        late: ticks by which the symbol begins after its first tick; before it if negative.
        last, next_: light of the symbols before and after.
    """
    if number == 0 and late > 0:
        return light + late * (last - light)
    if number == ticks - 1 and late < 0:
        return light - late * (next_ - light)
    return light


@njit(cache=True, nogil=True)
def explain(  # type: ignore[no-untyped-def]
    p0, p1, spikes, charge, later, late, last, next_, low, high, kernel, first, fires, hard, out
):
    """Computes how probable a symbol's spikes are under each light, (pixels, lights) float32 `out`.

    Args:
        spikes: (pixels, ticks) uint8; above 1 for a tick that is not known.
        charge, later: (pixels, states) float32, messages from the symbols before and after.
        late: (pixels,) float32, as for `shared`.
        last, next_: (pixels,) float32, light of the symbols before and after, thresholds.
        low, high: (pixels,) int64, range of the lights that a pixel may have, steps of LIGHTS.
        kernel, first, fires, hard: kernel, first, fires and hard as for `tick`.
    """
    states, ticks = charge.shape[1], spikes.shape[1]
    for p in range(p0, p1):
        one, two = np.empty(states, np.float32), np.empty(states, np.float32)
        begin, stop = _range(charge[p])
        most = np.float32(0.0)
        for m in range(low[p], high[p]):
            light = np.float32(m) / np.float32(LIGHTS)
            one[:] = charge[p]
            a, b = begin, stop
            for j in range(ticks):
                if spikes[p, j] > 1:
                    continue
                now = shared(light, j, ticks, late[p], last[p], next_[p])
                a, b = tick(one, a, b, now, spikes[p, j] > 0, kernel, first, fires, hard, two)
                one, two = two, one
            total = np.float32(0.0)
            for g in range(a, b):
                total += one[g] * later[p, g]
            out[p, m] = total
            most = max(most, total)
        scale = np.float32(1.0) / most if most > np.float32(1e-30) else np.float32(0.0)
        for m in range(low[p], high[p]):
            # Never impossible: a defective pixel must not overrule all others.
            out[p, m] = max(out[p, m] * scale, np.float32(1e-4))


@njit(cache=True, nogil=True)
def _range(charge):  # type: ignore[no-untyped-def]
    """Range of states with a probability."""
    low, high = 0, charge.size
    while low < high - 1 and charge[low] <= _LEAST:
        low += 1
    while high > low + 1 and charge[high - 1] <= _LEAST:
        high -= 1
    return low, high


@njit(cache=True, nogil=True)
def _at(law, light):  # type: ignore[no-untyped-def]
    """Law of a pixel at a light, thresholds, linearly between its steps."""
    place = light * np.float32(LIGHTS)
    m = min(max(int(place), 0), law.size - 2)
    return law[m] + (place - np.float32(m)) * (law[m + 1] - law[m])


@njit(cache=True, nogil=True)
def _chance(value):  # type: ignore[no-untyped-def]
    """Probability of a log likelihood ratio."""
    return np.float32(1.0 / (1.0 + exp(-value)))


@njit(cache=True, nogil=True)
def messages(p0, p1, law, cell, share, many, on, base, total, back):  # type: ignore[no-untyped-def]
    """Computes the messages of all pixels to the cells that they see, in place.

    Args:
        law: (pixels, lights) float32 of `explain`.
        cell: (pixels, seen) int64; share: (pixels, seen) float32, light of a cell that is on, over
            that of all.
        many: (pixels,) int64, cells that are summed over; of the others, the mean counts.
        on: light of a pixel with all cells on, thresholds.
        base: light with all off.
        total: (cells,) float32, log likelihood ratios of the cells.
        back: (pixels, seen) float32, last messages, overwritten.
    """
    for p in range(p0, p1):
        size = 1 << many[p]
        light, joint = np.empty(size, np.float32), np.empty(size, np.float32)
        chance = np.empty(many[p], np.float32)
        rest = base
        for k in range(many[p], cell.shape[1]):
            rest += on * share[p, k] * _chance(total[cell[p, k]])
        light[0] = rest
        joint[0] = np.float32(1.0)
        # joint: probability of the bits of the first k cells, then law of their light
        for k in range(many[p]):
            chance[k] = _chance(total[cell[p, k]] - back[p, k])
            half = 1 << k
            for c in range(half):
                light[c + half] = light[c] + on * share[p, k]
                joint[c + half] = joint[c] * chance[k]
                joint[c] *= np.float32(1.0) - chance[k]
        for c in range(size):
            light[c] = _at(law[p], light[c])
        for k in range(many[p] - 1, -1, -1):
            half = 1 << k
            # joint of the first k cells alone, by a sum over cell k
            up, down = np.float32(0.0), np.float32(0.0)
            for c in range(half):
                joint[c] += joint[c + half]
                up += joint[c] * light[c + half]
                down += joint[c] * light[c]
                light[c] += chance[k] * (light[c + half] - light[c])
            back[p, k] = np.float32(log(max(float(up), 1e-30)) - log(max(float(down), 1e-30)))


@njit(cache=True, nogil=True)
def decide(cell0, cell1, known, begin, of_pixel, of_seen, back, damping, limit, total):  # type: ignore[no-untyped-def]
    """Sums the messages to each cell into `total`, (cells,) float32.

    Args:
        known: (cells,) float32, log likelihood ratios before any spike.
        begin: (cells + 1,) int64, where the messages of each cell begin in the next two.
        of_pixel, of_seen: pixel and place of a message.
        back: (pixels, seen) float32 messages.
        damping: share of the last total that is kept.
        limit: largest magnitude.
    """
    for cell in range(cell0, cell1):
        value = known[cell]
        for n in range(begin[cell], begin[cell + 1]):
            value += back[of_pixel[n], of_seen[n]]
        value = value + damping * (total[cell] - value)
        total[cell] = min(max(value, -limit), limit)


@njit(cache=True, nogil=True)
def _lights(cell, share, many, on, base, total, back, light, joint, weight):  # type: ignore[no-untyped-def]
    """Fills `weight`, (lights,), with the distribution of a pixel's light by its cells; returns its
    mean, thresholds."""
    weight[:] = np.float32(0.0)
    rest = base
    for k in range(many, cell.size):
        rest += on * share[k] * _chance(total[cell[k]])
    light[0], joint[0] = rest, np.float32(1.0)
    for k in range(many):
        chance, half = _chance(total[cell[k]] - back[k]), 1 << k
        for c in range(half):
            light[c + half] = light[c] + on * share[k]
            joint[c + half] = joint[c] * chance
            joint[c] *= np.float32(1.0) - chance
    mean = np.float32(0.0)
    for c in range(1 << many):
        mean += joint[c] * light[c]
        place = light[c] * np.float32(LIGHTS)
        m = min(max(int(place), 0), weight.size - 2)
        part = place - np.float32(m)
        weight[m] += joint[c] * (np.float32(1.0) - part)
        weight[m + 1] += joint[c] * part
    return mean


@njit(cache=True, nogil=True)
def advance(  # type: ignore[no-untyped-def]
    p0, p1, spikes, charge, late, last, next_, cell, share, many, on, base, total, back, lights,
    kernel, first, fires, hard, after, mean,
):  # fmt: skip
    """Computes the charge after a symbol, (pixels, states) float32 `after`, and the pixel's light
    by all that is known of its cells, (pixels,) float32 `mean`, thresholds.

    Args: as for `explain` and `messages`; lights: number of lights.
    """
    states, ticks = charge.shape[1], spikes.shape[1]
    for p in range(p0, p1):
        light, joint = np.empty(1 << many[p], np.float32), np.empty(1 << many[p], np.float32)
        weight = np.empty(lights, np.float32)
        _lights(cell[p], share[p], many[p], on, base, total, back[p], light, joint, weight)
        expected = base
        for k in range(cell.shape[1]):
            expected += on * share[p, k] * _chance(total[cell[p, k]])
        mean[p] = expected
        one, two = np.empty(states, np.float32), np.empty(states, np.float32)
        begin, stop = _range(charge[p])
        after[p] = np.float32(0.0)
        whole = np.float32(0.0)
        for m in range(lights):
            if weight[m] < np.float32(1e-5):
                continue
            one[:] = charge[p]
            a, b = begin, stop
            for j in range(ticks):
                if spikes[p, j] > 1:
                    continue
                value = np.float32(m) / np.float32(LIGHTS)
                now = shared(value, j, ticks, late[p], last[p], next_[p])
                a, b = tick(one, a, b, now, spikes[p, j] > 0, kernel, first, fires, hard, two)
                one, two = two, one
            for g in range(a, b):
                after[p, g] += weight[m] * one[g]
                whole += weight[m] * one[g]
        if whole > np.float32(1e-20):
            for g in range(states):
                after[p, g] /= whole
        else:  # impossible under these laws: nothing is known of the charge
            after[p, :LEVELS] = np.float32(1.0 / LEVELS)


@njit(cache=True, nogil=True)
def recede(  # type: ignore[no-untyped-def]
    p0, p1, spikes, later, late, last, next_, cell, share, many, on, base, total, back, lights,
    kernel, first, fires, hard, before,
):  # fmt: skip
    """Computes the probability of a symbol's spikes and all later ones by the charge before it,
    (pixels, states) float32 `before`, scaled to 1 at most.

    Args: as for `advance`, `later` as for `explain`.
    """
    states, ticks = later.shape[1], spikes.shape[1]
    for p in range(p0, p1):
        light, joint = np.empty(1 << many[p], np.float32), np.empty(1 << many[p], np.float32)
        weight = np.empty(lights, np.float32)
        _lights(cell[p], share[p], many[p], on, base, total, back[p], light, joint, weight)
        one, two = np.empty(states, np.float32), np.empty(states, np.float32)
        before[p] = np.float32(0.0)
        for m in range(lights):
            if weight[m] < np.float32(1e-3):
                continue
            one[:] = later[p]
            for j in range(ticks - 1, -1, -1):
                if spikes[p, j] > 1:
                    continue
                value = np.float32(m) / np.float32(LIGHTS)
                now = shared(value, j, ticks, late[p], last[p], next_[p])
                tick_back(one, now, spikes[p, j] > 0, kernel, first, fires, hard, two)
                one, two = two, one
            for g in range(states):
                before[p, g] += weight[m] * one[g]
        most = before[p].max()
        if most > np.float32(1e-20):
            for g in range(states):
                before[p, g] = max(before[p, g] / most, np.float32(1e-6))
        else:
            before[p] = np.float32(1.0)


def laws(most: float, shot: float, softness: float, hard: bool) -> tuple[Floats, Ints, Floats]:
    """(kernel, first, fires) of `tick`.

    Args:
        most: largest light of a tick, thresholds.
        shot: variance of the charge over its mean, thresholds.
        softness: standard deviation of the threshold, thresholds.
        hard: whether a spike removes all charge.
    """
    from scipy.special import ndtr

    light = np.arange(int(np.ceil(most * LIGHTS * _FINE)) + 2) / (LIGHTS * _FINE)
    mean, spread = light * LEVELS, np.sqrt(light * shot + 1e-8) * LEVELS
    first = np.maximum(np.rint(mean).astype(np.int64) - TAPS // 2 + 1, 0)
    z = (first[:, None] + np.arange(TAPS) - mean[:, None]) / spread[:, None]
    half = 0.5 / spread[:, None]
    kernel = np.maximum(ndtr(z + half) - ndtr(z - half), 0.0)
    kernel /= kernel.sum(axis=1, keepdims=True)
    states = int(np.ceil((1 + 5 * softness) * LEVELS)) + 1
    states += TAPS
    if not hard:  # the excess over the threshold stays, so it must be on the grid
        states += int(np.ceil(most * LEVELS))
    fires = ndtr((np.arange(states) - LEVELS) / (softness * LEVELS))
    return kernel.astype(np.float32), first, fires.astype(np.float32)
