"""The reference pixel with its circuit: integration, comparator delay and reset in closed form.

As in engine.py, the state of a pixel changes only at its events and at the ends of pieces of light.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from cosim.compute.philox_compiled import word_at
from cosim.compute.streams import Stream
from sensor.circuit.phases import DELAY, INTEGRATE, RESET, steady_interval, within
from sensor.device.charge import later
from sensor.latched.pixel.model import JUMP, ROOM
from sensor.latched.reference.engine import first_latch, latched, often, piece_at, rate_at
from sensor.latched.reference.law import draw

_STREAM = np.uint64(Stream.SHOT_NOISE)
_SAME = 2.0**-50


# Many arguments, for the reason in engine.py.
@njit(cache=True, error_model="numpy", nogil=True)
def _stored(  # type: ignore[no-untyped-def]
    begins, ends, first, last, i, tick, part, stop, phase, charge, volts, wait, goal, circuit
):
    """Charge of the current interval at `stop` (ps), with no event before it.

    During the comparator delay it is beyond the threshold, and its leak is neglected. During the
    reset it is 0.
    """
    if phase == RESET:
        return 0.0
    if phase == DELAY:
        while tick < stop:
            i = piece_at(begins, ends, i, tick)
            rate, slope, end = rate_at(begins, ends, first, last, i, tick, part)
            until = min(end, stop) if end > tick else stop
            left = float(until - tick) - part
            charge += (rate + 0.5 * slope * left) * left
            tick, part = until, 0.0
        return charge
    while tick < stop:
        i = piece_at(begins, ends, i, tick)
        rate, slope, end = rate_at(begins, ends, first, last, i, tick, part)
        until = min(end, stop) if end > tick else stop
        left = float(until - tick) - part
        _, charge, volts = within(phase, charge, volts, wait, math.inf, rate, slope, left, circuit)
        tick, part = until, 0.0
    return min(charge, goal)


# Many arguments, for the reason in engine.py.
@njit(cache=True, error_model="numpy", nogil=True)
def expose_circuit(  # type: ignore[no-untyped-def]
    p0, p1, ticks, parts, charges, goals, spikes, held, phases, outputs, waits, pixels, rows,
    begins, ends, first, last, latches, circuit, q, kind, sigma, table, functions, seed, words,
):  # fmt: skip
    """Runs pixels as `engine.expose` does under `residual`, with these further arguments.

    Args:
        phases: (n,) phase of each pixel (sensor/circuit/phases.py).
        outputs: (n,) output of its comparator, V.
        waits: (n,) ps until the end of its reset.
        circuit: `Circuit.packed()`.
    """
    cycles = latches.shape[1] - 1
    for p in range(p0, p1):
        rate0, rate1, edges = first[p], last[p], latches[rows[p]]
        tick, part, charge, goal, k = ticks[p], parts[p], charges[p], goals[p], spikes[p]
        phase, volts, wait = phases[p], outputs[p], waits[p]
        pixel = np.uint64(pixels[p])
        stop, rate_of_latches = edges[cycles], often(edges)
        i = np.int64(-1)  # a literal would compile `piece_at` a second time
        while True:
            i = piece_at(begins, ends, i, tick)
            rate, slope, end = rate_at(begins, ends, rate0, rate1, i, tick, part)
            left = max(float(end - tick) - part, 0.0)
            if phase == INTEGRATE and goal - charge <= goal * _SAME:
                t, after, output = 0.0, goal, 0.0
            else:
                t, after, output = within(
                    phase, charge, volts, wait, goal, rate, slope, left, circuit
                )
            if t > left:
                if end > stop or tick == stop:
                    held[p] = _stored(
                        begins, ends, rate0, rate1, i, tick, part, stop, phase, charge, volts,
                        wait, goal, circuit,
                    )  # fmt: skip
                    break
                tick, part, charge, volts = end, 0.0, after, output
                wait -= left
                continue
            at, at_part = tick, part
            if t > 0.0:
                if t > 2.0 * (float(stop - tick) + 2.0):
                    at = stop + 1
                else:
                    at, at_part = later(tick, part, t)
                    at, at_part, _ = latched(edges, rate_of_latches, at, at_part, t)
            if at > stop or (at == stop and at_part > 0.0):
                held[p] = _stored(
                    begins, ends, rate0, rate1, i, tick, part, stop, phase, charge, volts, wait,
                    goal, circuit,
                )  # fmt: skip
                break
            tick, part, charge = at, at_part, after
            if phase == INTEGRATE:
                phase, volts = DELAY, 0.0
                continue
            if phase == DELAY:
                c = first_latch(edges, rate_of_latches, tick, part)
                words[c >> 5, p] |= np.uint32(1 << (c & 31))
                k += np.uint64(1)
                goal = q
                if kind > 0:
                    word = np.int64(word_at(pixel, k, np.uint64(0), seed, _STREAM))
                    goal = draw(kind, q, sigma, table, functions, word)
                phase, volts, wait = RESET, 0.0, circuit[7]
                continue
            phase = DELAY if charge >= goal else INTEGRATE
            wait = 0.0
            # Skip whole intervals of the mean threshold, under the mean light up to the latch or
            # the end of the piece.
            i = piece_at(begins, ends, i, tick)
            rate, slope, end = rate_at(begins, ends, rate0, rate1, i, tick, part)
            c = first_latch(edges, rate_of_latches, tick, part)
            if c >= cycles:
                continue
            left = float(min(edges[c + 1], end) - tick) - part
            if (rate + 0.5 * slope * left) * left > (ROOM + 1) * (q - min(charge, q)):
                one = steady_interval(charge, q, rate + 0.5 * slope * left, circuit)
                if left > (ROOM + 1) * one and one > 0.0:
                    whole = math.floor(left / one) - JUMP - 1.0
                    words[c >> 5, p] |= np.uint32(1 << (c & 31))
                    tick, part = later(tick, part, whole * one)
                    k += np.uint64(whole)
        ticks[p], parts[p], charges[p], goals[p], spikes[p] = tick, part, charge, goal, k
        phases[p], outputs[p], waits[p] = phase, volts, wait
