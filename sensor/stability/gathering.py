"""Cases 1 to 3: charge is neither made nor lost, however long, however dim."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock, Light, Piece
from cosim.compute.opencl import Device
from cosim.run.case import Case
from sensor import EFFECTS, make_pixels
from sensor.asynchronous import AsynchronousPixels, EventModel
from sensor.latched.effects import RESIDUAL
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE, Charge, Span
from sensor.latched.pixel.model import ExactModel

CLOCK: Final = Clock(40_000)
"""Latch clock of SpikeTwo."""
_BLOCK: Final = 1 << 20
Counts = npt.NDArray[np.int64]


def constant(level: npt.ArrayLike, stop: int, start: int = 0) -> Light:
    """One row of pixels under steady light from `start` to `stop` (ps)."""
    plane = np.atleast_2d(np.asarray(level, np.float32))
    return Light((Piece(start, stop, plane, plane),))


# 1 -------------------------------------------------------------------------------------------

Gather = Callable[[Charge, float, int], tuple[Counts, Charge]]
"""(charge a cycle of each pixel in Q24.40, threshold in electrons, cycles) -> (latched spikes, what
is stored at the end in Q24.40)."""


def _gathering(device: Device | None) -> Gather:
    def gather(charge: Charge, threshold: float, cycles: int) -> tuple[Counts, Charge]:
        model = ExactModel(threshold, 1, (RESIDUAL,))
        pixels = make_pixels(model, np.arange(charge.size, dtype=np.uint32), device)
        counts, left = np.zeros(charge.size, np.int64), cycles
        while left:
            now = min(left, _BLOCK)
            words = pixels.expose([Span(0, now, charge)], now)
            counts += np.bitwise_count(words).sum(axis=0, dtype=np.int64)
            left -= now
        return counts, model.q - 1 - pixels.state().deficit

    return gather


def conservation(gather: Gather, cycles: int = 10**9) -> float:
    """Largest |input - spikes Q - rest| of sixteen pixels, in 2^-40 e; infinite where a rest is
    none."""
    threshold = 18_725.0
    q = int(threshold) * ONE
    shares = np.geomspace(2.0**-24, 0.93, 13)
    charge = np.array([1, *(int(s * q) | 1 for s in shares), q - 1, q], np.int64)
    counts, rest = gather(charge, threshold, cycles)
    worst = 0
    for c, n, r in zip(charge.tolist(), counts.tolist(), rest.tolist(), strict=True):
        if not 0 <= r < q:
            return float("inf")
        worst = max(worst, abs(c * cycles - n * q - r))
    return float(worst)


# 2 -------------------------------------------------------------------------------------------

Count = Callable[[npt.NDArray[np.float32], float, int], Counts]
"""(light in electrons a second, threshold in electrons, cycles at 40 kHz) -> spikes."""


def _counting(device: Device | None) -> Count:
    def count(light: npt.NDArray[np.float32], threshold: float, cycles: int) -> Counts:
        exposure = Exposure(CLOCK, 1.0)
        steady = constant(light, CLOCK.edge(cycles))
        model = ExactModel(threshold, 1, (RESIDUAL,))
        pixels = make_pixels(model, np.arange(light.size, dtype=np.uint32), device)
        counts = np.zeros(light.size, np.int64)
        for start in range(0, cycles, _BLOCK):
            now = min(cycles - start, _BLOCK)
            words = pixels.expose(exposure.spans(steady, start, now), now)
            counts += np.bitwise_count(words).sum(axis=0, dtype=np.int64)
        return counts

    return count


def dim_counts(count: Count, cycles: int = 200_000_000) -> float:
    """Largest |spikes - floor(electrons / Q)| at 20, 50 and 100 e/s, Q = C V / e at 5 fF, 0.6 V."""
    exact = Fraction("5e-15") * Fraction("0.6") / Fraction("1.602176634e-19")
    rates = (20, 50, 100)
    counts = count(np.array(rates, np.float32), float(exact), cycles)
    gathered = (rate * cycles * CLOCK.period // exact for rate in rates)
    return float(max(abs(int(n) - g) for n, g in zip(counts, gathered, strict=True)))


# 3 -------------------------------------------------------------------------------------------

Dark = Callable[[int], tuple[float, int]]
"""(picoseconds) -> (spikes, NaN if there is one anywhere, and turns of the inner loop)."""


def _dark(device: Device | None) -> Dark:
    def dark(ps: int) -> tuple[float, int]:
        model = EventModel(100, 1, Clock(10**9), shortest=1000, delay=500, reset=500)
        light = constant(np.zeros(64), ps)
        fired = AsynchronousPixels(model, (1, 64), 1.0).step(light, 0, ps)
        pixels = make_pixels(
            ExactModel(100.0, 1, tuple(EFFECTS.values())), np.arange(64, dtype=np.uint32), device
        )
        cycles = min(ps * CLOCK.num // PS, 4096)
        words = pixels.expose([Span(0, cycles, np.zeros(64, np.int64))], cycles)
        spikes = len(fired) + float(fired.exact.sum()) + int(np.bitwise_count(words).sum())
        return spikes, fired.work

    return dark


def darkness(dark: Dark) -> float:
    """Spikes in 1 s and in 1e6 s without light, and turns that the longer time takes more."""
    (few, short), (many, long) = dark(PS), dark(10**6 * PS)
    return few + many + abs(long - short)


GATHERING: Final = (
    Case(
        1,
        "a billion cycles",
        "charge in = spikes Q + rest, to the last bit, for 16 pixels of 1e9 cycles each",
        "Python integers",
        "float32 accumulator",
        "2^-40 e",
        0.0,
        conservation,
        _gathering,
        {"cycles": 1_000_000},
    ),
    Case(
        2,
        "dim light",
        "spikes of 20, 50 and 100 e/s in 5 fF x 0.6 V over 2e8 cycles = floor(electrons / Q)",
        "fractions of the decimal constants",
        "float32 accumulator",
        "spikes",
        0.0,
        dim_counts,
        _counting,
        {"cycles": 40_000_000},
    ),
    Case(
        3,
        "no light, no dark current",
        "0 spikes, no NaN, and no more work in 1e6 s than in 1 s",
        "0",
        "stepping cycle by cycle",
        "spikes + turns",
        0.0,
        darkness,
        _dark,
    ),
)
