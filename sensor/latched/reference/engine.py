"""The inner loop of the reference pixel: from spike to spike in continuous time.

The state of a pixel changes only at its events and at the ends of pieces of light, never at the end
of a call. An interval that is not complete is computed again from its anchor in the next call, so a
run gives the same bits however it is split.

Light on a pixel is piecewise linear, in float64. Piece i runs from `begins[i]` to `ends[i]` (ps, no
gaps), and its rate from `first[i]` to `last[i]` (electrons a picosecond). Before the first piece,
light has the rate of the start of that piece.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from cosim.compute.philox_compiled import pick, random_words
from cosim.compute.streams import Stream
from sensor.device.charge import crossing, exposure, later
from sensor.latched.pixel.charge import LARGEST
from sensor.latched.pixel.model import JUMP, ROOM
from sensor.latched.reference.bank_draws import bank_entry
from sensor.latched.reference.law import draw

_SAME = 2.0**-50
"""Relative tolerance within which an instant counts as at a latch."""
_INSTANT = 2.0**-20
"""Rounding error of an instant in picoseconds, independent of the interval."""
_STREAM = np.uint64(Stream.SHOT_NOISE)
_PILED = float(LARGEST)
"""Most electrons beyond a threshold under `subtract`."""


# Arrays are separate arguments: unpacking records takes 3 us a call.
@njit(cache=True, error_model="numpy", nogil=True)
def expose(  # type: ignore[no-untyped-def]
    p0, p1, ticks, parts, charges, goals, spikes, held, pixels, rows, begins, ends, first, last,
    latches, rule, dead, q, kind, sigma, table, functions, seed, bank, keys, lanes, begin, words,
):  # fmt: skip
    """Runs pixels `p0` to `p1` over the cycles of `latches` and sets their bits in `words`.

    Args:
        ticks, parts: (n,) anchor, the instant from which light is integrated: ps and a fraction.
        charges: (n,) electrons at the anchor.
        goals: (n,) electrons, threshold of the current interval.
        spikes: (n,) index of the current interval.
        held: (n,) electrons at the last latch; an output.
        pixels: (n,) numbers of the pixels.
        rows: (n,) the row of `latches` that each pixel has.
        begins, ends: (pieces,) ps.
        first, last: (n, pieces) electrons a picosecond at the begin and the end of a piece.
        latches: (rows, cycles + 1) ps, ascending: each cycle runs from one to the next.
        rule: 0 residual, 1 hard, 2 subtract.
        dead: dead time, ps.
        q, kind, sigma, table, functions: distribution of thresholds, see `Law`.
        seed: seed of the run.
        bank, keys, lanes: thresholds in the bank, and which pixels draw from it; see `BankDraws`.
            Their index of the interval is the latest spike: twice the number of the cycle after it,
            plus 1 if it was not the first of its cycle; 0 for none.
        begin: first cycle.
        words: (ceil(cycles / 32), n) uint32; an output.
    """
    cycles = latches.shape[1] - 1
    for p in range(p0, p1):
        rate0, rate1, edges = first[p], last[p], latches[rows[p]]
        tick, part, charge, goal, k = ticks[p], parts[p], charges[p], goals[p], spikes[p]
        pixel = np.uint64(pixels[p])
        stop, rate_of_latches = edges[cycles], often(edges)
        i, done = np.int64(-1), -1  # a literal would compile `piece_at` a second time
        slope, end = slope_on(begins, ends, rate0, rate1, i)
        block = ~np.uint64(0)  # of the random words that are known
        w0 = w1 = w2 = w3 = np.uint64(0)
        # Cycle of the latest spike, and the spikes before it in that cycle.
        latest, passed = np.int64(-1), np.int64(0)
        if tick < begins[0] and begins[0] > 0:
            # The pieces were cut anew: start from the charge at the last latch.
            tick, part, charge = max(tick, edges[0]), 0.0, held[p]
        while True:
            if tick > stop or (tick == stop and part > 0.0):
                held[p] = charge
                break
            need = goal - charge
            j = piece_at(begins, ends, i, tick)
            if j != i:
                i = j
                slope, end = slope_on(begins, ends, rate0, rate1, i)
            rate = rate_on(begins, rate0, slope, i, tick, part)
            if need <= goal * _SAME:
                at, at_part = tick, part
                c = first_latch(edges, rate_of_latches, at, at_part)
            else:
                if tick == stop:
                    held[p] = charge
                    break
                left = float(end - tick) - part
                x = crossing(rate, slope, need)
                if x > left:
                    if end > stop:
                        held[p] = charge + exposure(rate, slope, float(stop - tick) - part)
                        break
                    charge += exposure(rate, slope, left)
                    tick, part = end, 0.0
                    continue
                if x > 2.0 * (float(stop - tick) + 2.0):
                    held[p] = charge + integrate(begins, ends, rate0, rate1, i, tick, part, stop)
                    break
                at, at_part = later(tick, part, x)
                at, at_part, c = latched(edges, rate_of_latches, at, at_part, x)
                if at > stop or (at == stop and at_part > 0.0):
                    held[p] = charge + integrate(begins, ends, rate0, rate1, i, tick, part, stop)
                    break
            if rule > 0:
                c = max(c, done + 1)
                if c >= cycles:
                    held[p] = charge
                    break
                done = c
            words[c >> 5, p] |= np.uint32(1 << (c & 31))
            latch = edges[c + 1]
            fresh = q
            if lanes[p] >= 0:
                passed = passed + np.int64(1) if c == latest else np.int64(0)
                latest = c
                k = np.uint64(2 * (begin + c + 1) + min(passed, 1))
                fresh = bank[bank_entry(keys[p], lanes[p], begin + c, passed)]
            else:
                k += np.uint64(1)
            if kind > 0 and lanes[p] < 0:
                if k >> np.uint64(2) != block:  # four spikes share a counter
                    block = k >> np.uint64(2)
                    w0, w1, w2, w3 = random_words(pixel, block, np.uint64(0), seed, _STREAM)
                word = np.int64(pick(k, w0, w1, w2, w3))
                fresh = draw(kind, q, sigma, table, functions, word)
            if rule > 0:
                if rule == 2:
                    charge += integrate(begins, ends, rate0, rate1, i, tick, part, latch) - goal
                    charge = min(charge, fresh + _PILED)
                else:
                    charge = 0.0
                goal = fresh
                tick, part = later(latch, 0.0, dead)
                continue
            goal, charge = fresh, 0.0
            if dead == 0.0:
                tick, part = at, at_part
                rest = integrate(begins, ends, rate0, rate1, i, tick, part, latch) - goal
                if rest > ROOM * q:
                    # Take whole thresholds off at once, as the exact tier does at this latch. The
                    # current interval stands for all of them; JUMP are left to be drawn.
                    whole = max(math.floor(rest / q) - JUMP, 0.0)
                    goal += whole * q
                    if lanes[p] < 0:
                        k += np.uint64(whole)
                continue
            tick, part = later(at, at_part, dead)
            # Skip whole intervals of the mean length, threshold / light + dead time, up to the
            # latch or the end of the piece.
            j = piece_at(begins, ends, i, tick)
            if j != i:
                i = j
                slope, end = slope_on(begins, ends, rate0, rate1, i)
            left = float(min(latch, end) - tick) - part
            if left > 0.0:
                mean = rate_on(begins, rate0, slope, i, tick, part) + 0.5 * slope * left
                # The first condition follows from the last, and divides nothing.
                if mean > 0.0 and left * mean > ROOM * (q + dead * mean):
                    one = q / mean + dead
                    if left > (ROOM + 1) * one:
                        whole = math.floor(left / one) - JUMP - 1.0
                        tick, part = later(tick, part, whole * one)
                        if lanes[p] < 0:
                            k += np.uint64(whole)
        ticks[p], parts[p], charges[p], goals[p], spikes[p] = tick, part, charge, goal, k


@njit(cache=True, error_model="numpy", nogil=True)
def often(edges):  # type: ignore[no-untyped-def]
    """Mean number of latches a picosecond."""
    return (edges.size - 1) / float(edges[edges.size - 1] - edges[0])


@njit(cache=True, error_model="numpy", nogil=True)
def first_latch(edges, rate, tick, part):  # type: ignore[no-untyped-def]
    """The first cycle whose latch, edges[c + 1], is not before the instant tick + part; edges.size
    - 1 if there is none. rate: `often` of the edges."""
    cycles = edges.size - 1
    if part > 0.0:
        tick += 1
    if tick <= edges[0]:
        return 0
    if tick > edges[cycles]:
        return cycles
    c = min(int((tick - edges[0]) * rate), cycles - 1)
    while edges[c + 1] < tick:
        c += 1
    while edges[c] >= tick:
        c -= 1
    return c


@njit(cache=True, error_model="numpy", nogil=True)
def latched(edges, rate, tick, part, span):  # type: ignore[no-untyped-def]
    """The instant tick + part, moved to a latch within the rounding error of `span` (ps), and its
    `first_latch`: (tick, part, cycle)."""
    near = tick + 1 if part > 0.5 else tick
    c = first_latch(edges, rate, near, 0.0)
    if c < edges.size - 1 and edges[c + 1] == near:
        away = abs(part - 1.0) if part > 0.5 else part
        if away <= span * _SAME + _INSTANT:
            return near, 0.0, c
        if part <= 0.5:  # just beyond this latch
            c += 1
    return tick, part, c


@njit(cache=True, error_model="numpy", nogil=True)
def piece_at(begins, ends, i, tick):  # type: ignore[no-untyped-def]
    """Index of the piece at `tick` (ps), searched from piece i on; -1 before the first piece."""
    if tick < begins[0]:
        return -1
    i = max(i, 0)
    while i < ends.size - 1 and ends[i] <= tick:
        i += 1
    return i


@njit(cache=True, error_model="numpy", nogil=True)
def slope_on(begins, ends, first, last, i):  # type: ignore[no-untyped-def]
    """(slope, end) of piece i: change of its rate, electrons a picosecond a picosecond, and the
    instant up to which it is valid."""
    if i < 0:
        return 0.0, begins[0]
    if first[i] == last[i]:
        return 0.0, ends[i]
    return (last[i] - first[i]) / (ends[i] - begins[i]), ends[i]


@njit(cache=True, error_model="numpy", nogil=True)
def rate_on(begins, first, slope, i, tick, part):  # type: ignore[no-untyped-def]
    """Rate at the instant tick + part (ps) in piece i of this slope, electrons a picosecond."""
    if slope == 0.0:
        return first[max(i, 0)]
    return max(first[i] + slope * (float(tick - begins[i]) + part), 0.0)


@njit(cache=True, error_model="numpy", nogil=True)
def rate_at(begins, ends, first, last, i, tick, part):  # type: ignore[no-untyped-def]
    """(rate, slope, end) at the instant tick + part (ps) in piece i; see `slope_on`."""
    slope, end = slope_on(begins, ends, first, last, i)
    return rate_on(begins, first, slope, i, tick, part), slope, end


@njit(cache=True, error_model="numpy", nogil=True)
def integrate(begins, ends, first, last, i, tick, part, until):  # type: ignore[no-untyped-def]
    """Electrons from the instant tick + part (ps) in piece i to a later whole picosecond."""
    total = 0.0
    while tick < until:
        i = piece_at(begins, ends, i, tick)
        rate, slope, end = rate_at(begins, ends, first, last, i, tick, part)
        stop = until if end < tick + 1 or until < end else end  # the last piece runs on
        total += exposure(rate, slope, float(stop - tick) - part)
        tick, part = stop, 0.0
    return total
