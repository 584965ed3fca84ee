"""Naive methods, one for each case of the stability suite: what the case must catch.

Each has the shape of the method that ships (see scenarios/stability) and is how one would write it
first.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from fractions import Fraction
from hashlib import sha256

import numpy as np
from numba import njit

from cosim import PS, Clock, Light, Piece
from cosim.compute.streams import Stream
from sensor.latched.pixel.charge import ONE
from sensor.stability.bright import Sunlit
from sensor.stability.cutting import CYCLES, SMALL, Cut, plain_bits
from sensor.stability.denormals import flushing
from sensor.stability.firing import Sine
from sensor.stability.gathering import CLOCK
from sensor.stability.ticks import Counters, Edges


@njit(cache=True)
def _accumulate(charge, threshold, cycles):  # type: ignore[no-untyped-def]
    """Spikes and rest of one pixel, all in float32."""
    held, spikes = np.float32(0), 0
    for _ in range(cycles):
        held += charge
        if held >= threshold:
            held -= threshold
            spikes += 1
    return spikes, held


def float32_accumulator(charge, threshold, cycles):  # type: ignore[no-untyped-def]
    """Case 1."""
    made = [_accumulate(np.float32(c / ONE), np.float32(threshold), cycles) for c in charge]
    spikes, rest = zip(*made, strict=True)
    return np.array(spikes), np.array([int(float(r) * ONE) for r in rest])


def float32_counts(light, threshold, cycles):  # type: ignore[no-untyped-def]
    """Case 2."""
    return np.array(
        [_accumulate(np.float32(v / 40e3), np.float32(threshold), cycles)[0] for v in light]
    )


def stepping_dark(ps: int) -> tuple[float, int]:
    """Case 3: a turn for each cycle."""
    return 0.0, CLOCK.cycle_at(ps)


ONE_A_CYCLE = Sunlit(
    latch=lambda light, threshold, cycles: 0,
    rate=lambda light, threshold, delay, reset, spikes: CLOCK.hz,
)
"""Case 4: a pixel that is looked at once a cycle fires at most as often."""


@njit(cache=True)
def _float32_firing(step, dead, spikes):  # type: ignore[no-untyped-def]
    now = np.float32(0)
    for _ in range(spikes):
        now += step
        now += dead
    return now


def float32_time(light: float, threshold: int, delay: int, reset: int, spikes: int) -> float:
    """Case 4: seconds in float32."""
    step, dead = np.float32(threshold / light), np.float32((delay + reset) / PS)
    return spikes / float(_float32_firing(step, dead, spikes))


def normal_thresholds(n: int, electrons: float, cycles: int):  # type: ignore[no-untyped-def]
    """Case 5: sqrt(Q) as the standard deviation of a normal threshold."""
    random = np.random.default_rng(1)
    drawn = np.maximum(1 + random.standard_normal((n, 80)), 0).cumsum(axis=1)
    return (drawn <= electrons * cycles).sum(axis=1)


def noise_once_a_pixel(n: int, threshold: float, sigma: float):  # type: ignore[no-untyped-def]
    """Case 6: a pixel whose noise is below zero fires for ever."""
    below = threshold + sigma * np.random.default_rng(1).standard_normal(n) < 0
    return np.where(below, 10**9, 1)


def light_at_the_edges(start: int, length: int, level: np.float32) -> Fraction:
    """Case 9: the light of a cycle taken as it is at its end."""
    seen = sum(
        start <= CLOCK.edge(k) < start + length
        for k in range(CLOCK.cycle_at(start), CLOCK.cycle_at(start) + 3)
    )
    return Fraction(float(level)) * CLOCK.period * seen


def _float32_bits(charge, q, cycles):  # type: ignore[no-untyped-def]
    """Case 11: charge in float32."""
    bits, held = np.zeros((cycles, charge.size), np.uint8), np.zeros(charge.size, np.float32)
    add, full = (charge / ONE).astype(np.float32), np.float32(q / ONE)
    for c in range(cycles):
        held += add
        fired = held >= full
        bits[c], held = fired, np.where(fired, held - full, held)
    return bits


def _windows(instants, first, cycles, both):  # type: ignore[no-untyped-def]
    """Case 11: cycles that take their two edges in, or leave them out."""
    at = np.array([CLOCK.edge(first + k) for k in range(cycles + 1)])[:, None]
    inside = (at[:-1] <= instants) & (instants <= at[1:])
    if not both:
        inside = (at[:-1] < instants) & (instants < at[1:])
    return inside.sum(axis=1)


def tie_methods(shipped: Edges) -> dict[str, Edges]:
    """Case 11: three ways to lose a tie."""
    return {
        "float32": shipped._replace(pixel=_float32_bits),
        "both edges": shipped._replace(latch=lambda i, f, c: _windows(i, f, c, True)),
        "neither edge": shipped._replace(latch=lambda i, f, c: _windows(i, f, c, False)),
    }


def squares_in_coulombs(flush: bool) -> Mapping[str, str]:
    """Case 17: the quadratic of a ramp, in coulombs and float32."""
    with flushing() if flush else nullcontext():
        tiny = np.full(8, 1e-42, np.float32) * np.float32(0.5)
        b = (np.arange(1, 500) * 1.602176634e-19 / 8).astype(np.float32)
        root = np.sqrt(b * b + 2 * (b / 100) * b)
    digest = {"canary": tiny.tobytes(), "root": root.tobytes()}
    return {name: sha256(data).hexdigest() for name, data in digest.items()}


def counter_methods(shipped: Counters) -> dict[str, Counters]:
    """Case 18: a counter of 32 bits in each place, and time in float32."""

    def edge(clock: Clock, k: int) -> int:
        return Clock.edge(clock, k & 0xFFFFFFFF)

    def charge(light: Light, start: int, cycles: int) -> list[int]:
        return shipped.charge(light, start & 0xFFFFFFFF, cycles)

    def seconds(light: Light, start: int, cycles: int) -> list[int]:
        times = (np.arange(start, start + cycles) + np.float32(0.5)) * np.float32(25e-6)
        at = [min(int(np.float32(t) * PS), light.pieces[-1].stop - 1) for t in times]
        return [round(float(light.at(t)[0, 0]) / 40e3 * ONE) for t in at]

    def draw(pixels, index):  # type: ignore[no-untyped-def]
        return shipped.draw(pixels, index & 0xFFFFFFFF or 1)

    return {
        "32-bit cycle": shipped._replace(edge=edge),
        "float32 time": shipped._replace(charge=seconds),
        "32-bit spike index": shipped._replace(draw=draw),
    }


def seed_plus_stream(pixels, index: int, seed: int, stream: Stream):  # type: ignore[no-untyped-def]
    """Case 19: effect 16 of seed 1 draws the numbers of effect 1 of seed 16."""
    random = np.random.default_rng([seed + stream, index])
    return random.random(int(pixels.max()) + 1)[pixels]


def drawn_in_order(cut: Cut):  # type: ignore[no-untyped-def]
    """Case 20: random numbers one after another, as a tile needs them; light as it was."""
    shape = SMALL.chip.height, SMALL.chip.width
    random, rows = np.random.default_rng(1), [*sorted(cut.rows), shape[0]]
    bits = np.zeros((CYCLES, *shape), np.uint8)
    rate = plain_bits().mean(axis=0)
    for first in cut.rows:
        stop = rows[rows.index(first) + 1]
        held = random.random((stop - first, shape[1]))
        for begin in range(0, CYCLES, cut.block):
            many = min(cut.block, CYCLES - begin)
            noise = random.normal(1, 0.05, (many, stop - first, shape[1]))
            for c in range(many):
                held = held + rate[first:stop] * noise[c]
                bits[begin + c, first:stop] = held >= 1
                held = held % 1
    return bits


def held_for_a_cycle(shipped: Sine) -> Sine:
    """Case 10: the light of a cycle taken as it is at its beginning."""

    def held(light: Light, stop: int) -> Light:
        levels = [light.at(CLOCK.edge(k)) for k in range(CLOCK.cycle_at(stop))]
        return Light(
            tuple(Piece(CLOCK.edge(k), CLOCK.edge(k + 1), v, v) for k, v in enumerate(levels))
        )

    return Sine(
        lambda light, threshold, stop: shipped.fire(held(light, stop), threshold, stop),
        shipped.latch,
    )


def no_time_to_decide(setting, instants, clock, pixels, spikes):  # type: ignore[no-untyped-def]
    """Case 12: whatever falls into the window."""
    phase = instants % clock.edge(1) / clock.edge(1)
    return np.minimum(phase, 1 - phase) < setting.window * clock.hz / 2


def delay_at_the_latch(light: float, threshold: int, delay: int, reset: int, stop: int):  # type: ignore[no-untyped-def]
    """Case 16: the spikes of a cycle, moved back by what the comparator took."""
    period = CLOCK.edge(1)
    held = light * period / PS * np.arange(1, stop // period + 1)
    latched = np.flatnonzero(np.diff(held // threshold, prepend=0)) + 1
    return np.array([CLOCK.edge(int(k)) - delay for k in latched], np.int64)
