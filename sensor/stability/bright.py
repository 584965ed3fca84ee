"""Cases 4 and 9: full sunlight on a small threshold, and a flash in ten seconds of dark."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np

from cosim import PS, Clock, Light, Piece
from cosim.compute.opencl import Device
from cosim.light.radiometry import photons_per_lux
from cosim.run.case import Case
from sensor import CHIPS, EFFECTS, make_pixels
from sensor.asynchronous import AsynchronousPixels, EventModel
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE, Span, to_fixed
from sensor.latched.pixel.model import ExactModel
from sensor.stability.gathering import CLOCK, constant

# 4 -------------------------------------------------------------------------------------------


class Sunlit(NamedTuple):
    """The functions that the cases of bright light call.

    Attributes:
        latch: (electrons a second, threshold, cycles at 40 kHz) -> latch bits that are 0.
        rate: (electrons a second, threshold, delay and reset in ps, spikes) -> spikes a second
            inside.
    """

    latch: Callable[[float, float, int], int]
    rate: Callable[[float, int, int, int, int], float]


def _sunlit(device: Device | None) -> Sunlit:
    def latch(light: float, threshold: float, cycles: int) -> int:
        model = ExactModel(threshold, 1, tuple(EFFECTS.values()))
        pixels = make_pixels(model, np.arange(64, dtype=np.uint32), device)
        charge = np.full(64, to_fixed(light / CLOCK.hz), np.int64)
        words = pixels.expose([Span(0, cycles, charge)], cycles)
        return 64 * cycles - int(np.bitwise_count(words).sum())

    def rate(light: float, threshold: int, delay: int, reset: int, spikes: int) -> float:
        clock = Clock(PS)  # ticks of a picosecond: the least width then binds nobody
        model = EventModel(threshold, 1, clock, 1, delay=delay, reset=reset, shot=False)
        stop = int(spikes * (threshold / light * PS + delay + reset) * 1.001)
        pixels = AsynchronousPixels(model, (1, 1), light)
        instants = pixels.step(constant([1.0], stop), 0, stop).instant
        return float((instants.size - 1) * PS / (instants[-1] - instants[0]))

    return Sunlit(latch, rate)


def saturation(method: Sunlit, spikes: int = 3_000_000) -> float:
    """Largest relative error of the inner rate against 1 / (Q / light + delay + reset); infinite
    where a latch bit is missing. Light is 1e5 lux on SpikeTwo, and Q = 100."""
    light = 1e5 * CHIPS["spiketwo"].electrons_per_lux(photons_per_lux(555.0))
    if method.latch(light, 100.0, 4096):
        return float("inf")
    worst = Fraction(0)
    for delay, reset in ((0, 0), (200, 300), (1000, 1)):
        exact = 1 / (Fraction(100) / Fraction(light) + Fraction(delay + reset, PS))
        given = Fraction(method.rate(light, 100, delay, reset, spikes))
        worst = max(worst, abs(given / exact - 1))
    return float(worst)


# 9 -------------------------------------------------------------------------------------------

Flash = Callable[[int, int, np.float32], Fraction]
"""(instant and length of a flash in ps, electrons a second) -> electrons that 10 s of dark with it
bring."""


def _flash(device: Device | None) -> Flash:
    def flash(start: int, length: int, level: np.float32) -> Fraction:
        dark, lit = np.zeros((1, 1), np.float32), np.full((1, 1), level, np.float32)
        light = Light(
            (
                Piece(0, start, dark, dark),
                Piece(start, start + length, lit, lit),
                Piece(start + length, 10 * PS, dark, dark),
            )
        )
        # The whole threshold is out of reach, so that all charge stands in the pixel at the end.
        pixels = make_pixels(ExactModel(2e6, 1, ()), np.zeros(1, np.uint32), device)
        before = int(pixels.state().deficit[0])
        exposure = Exposure(CLOCK, 1.0)
        for first in range(0, 400_000, 40_000):
            pixels.expose(exposure.spans(light, first, 40_000), 40_000)
        return Fraction(before - int(pixels.state().deficit[0]), ONE)

    return flash


def flashes(flash: Flash) -> float:
    """Largest relative error of the charge of 1 ns and 1 us, in a cycle and across an edge."""
    worst = Fraction(0)
    for length in (1000, 1_000_000):
        for start in (CLOCK.edge(123_456) + 7_654_321, CLOCK.edge(234_567) - length // 3):
            level = np.float32(5000 * PS / length)
            exact = Fraction(float(level)) * Fraction(length, PS)
            worst = max(worst, abs(flash(start, length, level) / exact - 1))
    return float(worst)


BRIGHT: Final = (
    Case(
        4,
        "1e5 lux on 100 electrons",
        "every latch bit is 1; 3.5 ns a spike: inner rate = 1 / (Q/light + delay + reset)",
        "fractions",
        "one spike a cycle",
        "relative",
        1e-9,
        saturation,
        _sunlit,
        {"spikes": 1_000_000},
    ),
    Case(
        9,
        "1 ns and 1 us flash in 10 s of dark",
        "its charge is gathered, within a cycle and across an edge",
        "fractions",
        "light sampled at the edges; a solver that is not restarted",
        "relative",
        1e-12,
        flashes,
        _flash,
    ),
)
